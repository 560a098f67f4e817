// Calls in work, and the one that ends them early.
#pragma once

#include <mutex>
#include <vector>

#include "frame_path/session.hpp"

namespace endosdk {

class Cancelling;

// One call in work, for as long as the object lives.
class Work {
 public:
  explicit Work(Cancelling& owner);
  ~Work();
  Work(const Work&) = delete;
  Work& operator=(const Work&) = delete;

  // Throws CANCELLED once the call was cancelled.
  void check() const;

  // Runs the network; a cancel that comes meanwhile stops it.
  void run(Session::Run& run);

 private:
  friend class Cancelling;
  class Running;

  Cancelling& owner_;
  bool cancelled_ = false;        // guarded by the owner's mutex, like the next
  Session::Run* run_ = nullptr;
};

class Cancelling {
 public:
  Cancelling() { works_.reserve(expected_calls); }

  // Cancels what is in work now, from any thread. Calls that begin later are not concerned.
  void cancel_all();

 private:
  friend class Work;
  static constexpr size_t expected_calls = 1024;  // so that a frame allocates nothing here

  std::mutex mutex_;
  std::vector<Work*> works_;
};

}  // namespace endosdk
