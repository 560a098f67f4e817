// What lies behind the handles of endosdk.h, and the calls inside them.
#pragma once

#include <endosdk/endosdk.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <vector>

#include "frame_path/stream.hpp"
#include "library/capi_structs.hpp"
#include "library/guarded.hpp"
#include "platform/fair_lock.hpp"

namespace endosdk {

// Calls inside a handle, which closing it waits for.
class Callers {
 public:
  void enter() {
    const std::lock_guard lock(mutex_);
    ++count_;
  }

  void leave() {
    const std::lock_guard lock(mutex_);
    if (--count_ == 0) none_.notify_all();
  }

  void wait_for_none() {
    std::unique_lock lock(mutex_);
    none_.wait(lock, [&] { return count_ == 0; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable none_;
  int count_ = 0;
};

// What the host asked for when it opened the estimator, and the frame path does not know.
struct OpenedWith {
  bool spinning = false;
  bool model_pinned = false;
  bool model_signed = false;
  bool runtime_pinned = false;
  int log_level = ENDO_LOG_WARNING;
};

}  // namespace endosdk

struct endo_estimator {
  std::shared_ptr<endosdk::FramePath> path;
  endosdk::OpenedWith with{};
  // The results of all its streams. The streams share it, because they may end later.
  std::shared_ptr<endosdk::ResultsInFlight> in_flight{};
  endosdk::OwnProcess process{};
  endosdk::Callers callers{};
};

struct endo_stream {
  std::unique_ptr<endosdk::Stream> stream;
  // One for each frame in flight, and one for the frame that is being received.
  std::vector<endosdk::ResultWriter> writers;
  std::vector<endo_result*> results;
  std::shared_ptr<endosdk::ResultsInFlight> in_flight;
  endosdk::OwnProcess process{};
  endosdk::FairLock submitting{};
  endosdk::FairLock receiving{};
  uint64_t submitted = 0;
  uint64_t received = 0;
  endosdk::Callers callers{};
};

namespace endosdk {

// One call inside a handle.
template <typename Handle>
class Call {
 public:
  Call(Handle* handle, const char* argument) : handle_(handle) {
    require_pointer(handle, argument);
    handle->process.check();
    handle_->callers.enter();
  }
  ~Call() { handle_->callers.leave(); }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

 private:
  Handle* handle_;
};

// Runs the body with the frame path of an estimator.
template <typename Body>
void with(endo_estimator* estimator, const Body& body) {
  const Call call(estimator, "estimator");
  body(*estimator->path);
}

}  // namespace endosdk
