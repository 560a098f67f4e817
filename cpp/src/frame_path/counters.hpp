// Counts that a frame path keeps over its life. They have their own lock, so that reports do not wait for frames.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>

#include "frame_path/frame.hpp"
#include "frame_path/latency.hpp"

namespace endosdk {

class Counters {
 public:
  // Gives a finished frame its number.
  uint64_t add(const FrameReport& report);
  void add_failure();

  struct Snapshot {
    uint64_t frames, failed, late;
    std::array<uint64_t, cause_count> causes;  // number of frames for which each cause was raised
    double rectify_ms, session_ms, postprocess_ms, trust_ms;  // means over all frames
    double p50_ms, p95_ms, p99_ms, longest_ms;
  };
  Snapshot snapshot() const;

 private:
  mutable std::mutex mutex_;
  LatencyHistogram latency_;
  uint64_t late_ = 0;
  std::array<uint64_t, cause_count> causes_{};
  uint64_t failed_ = 0;
  double rectify_ms_ = 0.0, session_ms_ = 0.0, postprocess_ms_ = 0.0, trust_ms_ = 0.0;  // sums over all frames
};

}  // namespace endosdk
