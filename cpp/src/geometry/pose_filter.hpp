// The pose error of a rig over a sequence of frames: each counts as much as it is sure of itself, older ones fade.
#pragma once

#include <optional>

#include "geometry/pose_error.hpp"

namespace endosdk {

class PoseFilter {
 public:
  // `corrected`: what the rectification of that frame already made up for. Frames without a measurement change nothing.
  void add(const PoseError& error, const PoseVector& corrected);

  // Against the calibration, without corrections; not measured before the first frame.
  const PoseError& value() const { return value_; }

  // Measured frames since the start.
  int frames() const { return frames_; }

 private:
  PoseMatrix information_{};
  PoseVector pull_{};
  PoseError value_;
  int frames_ = 0;
};

// A rig has drifted when it turned for certain, and by more than what does not matter.
bool has_drifted(const PoseError& steady);

// The next correction of a rectification, at most a tenth of a degree from the one before; none where there is nothing to
// gain for certain.
std::optional<PoseVector> next_correction(const PoseVector& before, const PoseError& steady);

}  // namespace endosdk
