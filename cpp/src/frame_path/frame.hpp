// One frame: its input, and the report that comes with its maps.
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

inline double milliseconds(Clock::duration taken) { return std::chrono::duration<double, std::milli>(taken).count(); }

inline double milliseconds(Clock::time_point from, Clock::time_point to) { return milliseconds(to - from); }

struct FramePair {
  ImageView left;
  ImageView right;
  ChannelOrder order = ChannelOrder::rgb;
  int64_t stamp_ns = 0;  // time of `Clock` at which the pair was taken; 0: not known

  Size size() const { return left.size(); }
};

inline int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count();
}

// Throws for frames without pixels, and for frames with too many bytes to count.
void check_frame_size(Size size, const char* argument);

// Throws unless both pictures have the same size and format.
void check_pair(const FramePair& pair);

struct FrameReport {
  uint64_t frame = 0;  // counts the frames of a frame path from 1
  double valid_share = 0.0;
  Causes causes;                       // causes of the pair, with their measures
  Quality quality = Quality::invalid;  // follows from the causes
  bool calibrated = false;
  PoseError pose;     // how far the rig is from its calibration; without a calibration only the vertical disparity
  PoseError steady;   // the same, averaged over the frames so far, without corrections
  PoseVector corrected{};  // pose error that the rectification of this frame corrected
  double rectify_ms = 0.0;
  double session_ms = 0.0;
  double postprocess_ms = 0.0;
  double trust_ms = 0.0;  // time to find out whether the result can be trusted, within the times above and after them
  double total_ms = 0.0;  // from the call to the result, including waiting
  bool late = false;
  int64_t stamp_ns = 0;  // time at which the pair was taken
  double age_ms = never;  // age of the pair when the result was returned; NaN if the stamp is not known
  std::shared_ptr<const Identity> identity;
  Prints prints;  // of both input frames
};

}  // namespace endosdk
