// The part of the expected depth error that comes from a rig that has moved, or from views of different scale. Both also move
// matches along the rows, where nothing shows it.
#pragma once

#include <array>

#include "geometry/pose_error.hpp"

namespace endosdk {

class RigSigma {
 public:
  // `focal_baseline` is in px * mm. Values that their standard errors explain add nothing.
  RigSigma(const PoseError& error, const PosePattern& pattern, double focal_baseline);

  // Adds the square of this error to the square of sigma, mm, in one row.
  void add(const float* depth, int y, int width, float* sigma) const;

 private:
  PosePattern pattern_;
  PoseVector variance_{};  // of rotations and scale; 0 for the baseline, which only moves matches across the rows
  double focal_baseline_;
  bool adds_ = false;
};

}  // namespace endosdk
