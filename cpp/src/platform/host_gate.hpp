// A gate for calls of the host's functions (log function and thread hook). After it is closed, they are not called any more.
#pragma once

#include <mutex>
#include <shared_mutex>

namespace endosdk {

class HostGate {
 public:
  // Calls the body if the gate is open. A null gate is always open.
  template <typename Body>
  static void pass(HostGate* gate, const Body& body) {
    if (gate == nullptr) return body();
    const std::shared_lock lock(gate->mutex_);
    if (gate->open_) body();
  }

  // Waits until running calls have ended. No call begins afterwards.
  void close() {
    const std::unique_lock lock(mutex_);
    open_ = false;
  }

 private:
  std::shared_mutex mutex_;
  bool open_ = true;
};

}  // namespace endosdk
