// What a rig that moved adds to the expected depth error: its turns move matches along the rows too, unseen.
#pragma once

#include <array>

#include "geometry/pose_error.hpp"

namespace endosdk {

class RigSigma {
 public:
  // `focal_baseline` in px * mm. Turns that their standard errors explain add nothing.
  RigSigma(const PoseError& error, const PosePattern& pattern, double focal_baseline);

  // Adds to one row of sigma, mm, in squares.
  void add(const float* depth, int y, int width, float* sigma) const;

 private:
  PosePattern pattern_;
  std::array<double, 3> variance_{};  // of each turn, radians squared
  double focal_baseline_;
  bool adds_ = false;
};

}  // namespace endosdk
