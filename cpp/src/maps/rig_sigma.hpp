// The part of the expected depth error that comes from a rig that has moved. Its rotations also move matches along the rows,
// where nothing shows it.
#pragma once

#include <array>

#include "geometry/pose_error.hpp"

namespace endosdk {

class RigSigma {
 public:
  // `focal_baseline` is in px * mm. Rotations that their standard errors explain add nothing.
  RigSigma(const PoseError& error, const PosePattern& pattern, double focal_baseline);

  // Adds the square of this error to the square of sigma, mm, in one row.
  void add(const float* depth, int y, int width, float* sigma) const;

 private:
  PosePattern pattern_;
  std::array<double, 3> variance_{};  // of each rotation, radians squared
  double focal_baseline_;
  bool adds_ = false;
};

}  // namespace endosdk
