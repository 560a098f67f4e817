#include "frame_path/turns.hpp"

namespace endosdk {

void Turn::wait() {
  std::unique_lock lock(turns_.mutex_);
  turns_.change_.wait(lock, [&] { return turns_.next_ == number_; });
}

void Turn::pass() {
  if (passed_) return;
  passed_ = true;
  wait();
  {
    const std::lock_guard lock(turns_.mutex_);
    ++turns_.next_;
  }
  turns_.change_.notify_all();
}

}  // namespace endosdk
