// Lets frames on several threads do a part of their work one after the other, in their order.
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

// The turn of one number. When this object is destroyed, the turn passes to the next number, whatever happened before.
class Turn {
 public:
  Turn(Turns& turns, uint64_t number) : turns_(turns), number_(number) {}
  ~Turn() { pass(); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

  // Waits until all earlier numbers have passed.
  void wait();

  // Passes the turn to the next number. If the turn has not come yet, waits for it first.
  void pass();

 private:
  Turns& turns_;
  const uint64_t number_;
  bool passed_ = false;
};

}  // namespace endosdk
