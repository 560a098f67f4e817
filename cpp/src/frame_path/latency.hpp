// The distribution of frame times, in a fixed amount of memory for any number of frames.
#pragma once

#include <array>
#include <cstdint>

namespace endosdk {

class LatencyHistogram {
 public:
  void add(double milliseconds);

  uint64_t count() const { return count_; }
  double longest_ms() const { return longest_ms_; }

  // The time below which this share of the frames stayed. It is at most 3 % too high, and 0 if there are no frames.
  double quantile_ms(double share) const;

 private:
  // Bounds grow by 2^(1/24), from 0.01 ms to more than two minutes.
  static constexpr int steps_per_octave = 24;
  static constexpr double first_ms = 0.01;

  std::array<uint64_t, 24 * steps_per_octave> bins_{};
  uint64_t count_ = 0;
  double longest_ms_ = 0.0;
};

}  // namespace endosdk
