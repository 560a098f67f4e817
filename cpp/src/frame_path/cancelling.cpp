#include "frame_path/cancelling.hpp"

#include <algorithm>

#include "platform/errors.hpp"

namespace endosdk {

// While this object lives, the run of the network can be stopped.
class Work::Running {
 public:
  Running(Work& work, Session::Run& run) : work_(work) {
    const std::lock_guard lock(work_.owner_.mutex_);
    run.resume();
    if (work_.cancelled_) run.stop();
    work_.run_ = &run;
  }

  ~Running() {
    const std::lock_guard lock(work_.owner_.mutex_);
    work_.run_ = nullptr;
  }

  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

 private:
  Work& work_;
};

Work::Work(Cancelling& owner) : owner_(owner) {
  const std::lock_guard lock(owner_.mutex_);
  owner_.works_.push_back(this);
}

Work::~Work() {
  const std::lock_guard lock(owner_.mutex_);
  owner_.works_.erase(std::find(owner_.works_.begin(), owner_.works_.end(), this));
}

void Work::check() const {
  const std::lock_guard lock(owner_.mutex_);
  if (cancelled_) fail(ENDO_CANCELLED, "estimator", "must not be cancelled for a call to give an answer", "a cancel");
}

void Work::run(Session::Run& run) {
  try {
    const Running running(*this, run);
    run();
  } catch (...) {
    check();  // a stopped run fails; then this throws CANCELLED instead
    throw;
  }
  check();
}

void Cancelling::cancel_all() {
  const std::lock_guard lock(mutex_);
  for (Work* work : works_) {
    work->cancelled_ = true;
    if (work->run_ != nullptr) work->run_->stop();
  }
}

}  // namespace endosdk
