// What a frame path counts over its life. It has a lock of its own: reports do not wait for frames.
#pragma once

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
    uint64_t frames, failed, late, mismatched;
    double p50_ms, p95_ms, p99_ms, longest_ms;
  };
  Snapshot snapshot() const;

 private:
  mutable std::mutex mutex_;
  LatencyHistogram latency_;
  uint64_t late_ = 0;
  uint64_t mismatched_ = 0;  // frames whose two views do not show the same
  uint64_t failed_ = 0;
};

}  // namespace endosdk
