// One frame on its way: what goes in, and what is said of it besides its maps.
#pragma once

#include <chrono>
#include <cstdint>

#include "frame_path/quality.hpp"
#include "images/image.hpp"

namespace endosdk {

using Clock = std::chrono::steady_clock;

inline double milliseconds(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double, std::milli>(to - from).count();
}

struct FramePair {
  ImageView left;
  ImageView right;
  ChannelOrder order = ChannelOrder::rgb;

  Size size() const { return {left.width, left.height}; }
};

// Refuses what is no pair of pictures of one size and format.
void check_pair(const FramePair& pair);

struct FrameReport {
  uint64_t frame = 0;  // counts the frames of a frame path from 1
  double valid_share = 0.0;
  Quality quality = Quality::invalid;
  double rectify_ms = 0.0;
  double session_ms = 0.0;
  double postprocess_ms = 0.0;
  double total_ms = 0.0;  // from the call to the answer, waiting included
  bool late = false;
  bool views_belong_together = true;
};

}  // namespace endosdk
