// Whether the host's own functions, those for log lines and of threads, may still be called.
#pragma once

#include <mutex>
#include <shared_mutex>

namespace endosdk {

class HostGate {
 public:
  // Calls the body, unless it is too late. Without a gate it is never too late.
  template <typename Body>
  static void pass(HostGate* gate, const Body& body) {
    if (gate == nullptr) return body();
    const std::shared_lock lock(gate->mutex_);
    if (gate->open_) body();
  }

  // Waits for the calls that run; none follows.
  void close() {
    const std::unique_lock lock(mutex_);
    open_ = false;
  }

 private:
  std::shared_mutex mutex_;
  bool open_ = true;
};

}  // namespace endosdk
