// One frame on its way: what goes in, and what is said of it besides its maps.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>

#include "frame_path/causes.hpp"
#include "frame_path/frozen.hpp"
#include "frame_path/identity.hpp"
#include "geometry/pose_error.hpp"
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
  int64_t stamp_ns = 0;  // of `Clock`, when the pair was taken; 0: not known

  Size size() const { return left.size(); }
};

inline int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count();
}

// Refuses frames of no size, and those too large for their bytes to be counted.
void check_frame_size(Size size, const char* argument);

// Refuses what is no pair of pictures of one size and format.
void check_pair(const FramePair& pair);

struct FrameReport {
  uint64_t frame = 0;  // counts the frames of a frame path from 1
  double valid_share = 0.0;
  Causes causes;                       // what is wrong with the pair
  Quality quality = Quality::invalid;  // follows from them
  bool calibrated = false;
  PoseError pose;     // how far the rig stands from its calibration; without one only the vertical disparity
  PoseError steady;   // the same over the frames so far, corrections not counted
  PoseVector corrected{};  // what the rectification of this frame made up for
  double rectify_ms = 0.0;
  double session_ms = 0.0;
  double postprocess_ms = 0.0;
  double trust_ms = 0.0;  // of these, and after them: what it took to find out whether the answer can be trusted
  double total_ms = 0.0;  // from the call to the answer, waiting included
  bool late = false;
  int64_t stamp_ns = 0;  // of the pair
  double age_ms = never;  // of the pair when the answer was handed out; not a number where the stamp is not known
  std::shared_ptr<const Identity> identity;
  Prints prints;  // of both frames, as they came
};

}  // namespace endosdk
