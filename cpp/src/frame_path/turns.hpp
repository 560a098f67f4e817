// Work of which frames on several threads each do a part, one after the other in their order.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace endosdk {

class Turns {
 private:
  friend class Turn;

  std::mutex mutex_;
  std::condition_variable change_;
  uint64_t next_ = 0;
};

// The turn of one number. It passes to the next number at the end of this object's life, whatever happens before.
class Turn {
 public:
  Turn(Turns& turns, uint64_t number) : turns_(turns), number_(number) {}
  ~Turn() { pass(); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

  // Until all numbers before have passed.
  void wait();

  // Waits for the turn first where that was not done.
  void pass();

 private:
  Turns& turns_;
  const uint64_t number_;
  bool passed_ = false;
};

}  // namespace endosdk
