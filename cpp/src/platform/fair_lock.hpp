// A mutex that waiting callers get in the order in which they came, so that a caller in a tight loop locks nobody out.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace endosdk {

class FairLock {
 public:
  void lock() {
    std::unique_lock lock(mutex_);
    const uint64_t mine = last_++;
    turn_.wait(lock, [&] { return mine == served_; });
  }

  void unlock() {
    {
      const std::lock_guard lock(mutex_);
      ++served_;
    }
    turn_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable turn_;
  uint64_t last_ = 0;    // tickets given out
  uint64_t served_ = 0;  // the ticket whose turn it is
};

}  // namespace endosdk
