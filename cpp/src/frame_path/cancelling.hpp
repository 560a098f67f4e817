// Running calls, and the call that cancels them.
#pragma once

#include <mutex>
#include <vector>

#include "frame_path/session.hpp"

namespace endosdk {

class Cancelling;

// One running call. The call lasts as long as this object lives.
class Work {
 public:
  explicit Work(Cancelling& owner);
  ~Work();
  Work(const Work&) = delete;
  Work& operator=(const Work&) = delete;

  // Throws CANCELLED if the call was cancelled.
  void check() const;

  // Runs the network. If the call is cancelled meanwhile, the run is stopped.
  void run(Session::Run& run);

 private:
  friend class Cancelling;
  class Running;

  Cancelling& owner_;
  bool cancelled_ = false;        // guarded by the owner's mutex, like `run_`
  Session::Run* run_ = nullptr;
};

class Cancelling {
 public:
  Cancelling() { works_.reserve(expected_calls); }

  // Cancels all calls that are running now, from any thread. Calls that begin later are not affected.
  void cancel_all();

 private:
  friend class Work;
  static constexpr size_t expected_calls = 1024;  // reserved, so that a frame allocates nothing here

  std::mutex mutex_;
  std::vector<Work*> works_;
};

}  // namespace endosdk
