// What a rig that has moved, or views of different scale, add to the expected depth error and take from the confidence. Both
// also move matches along the rows, where nothing shows it.
#pragma once

#include <array>

#include "geometry/pose_error.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {

class RigSigma {
 public:
  // `focal_baseline` is in px * mm; confidence is the probability of an error up to `limit_px`. Values that their standard
  // errors explain change nothing.
  RigSigma(const PoseError& error, const PosePattern& pattern, double focal_baseline, double limit_px);

  // Adds the square of this error to the square of sigma, mm, in one row.
  void add(const float* depth, int y, int width, float* sigma) const;

  // Lowers the confidence of one row by it.
  void doubt(int y, int width, float* confidence) const;

 private:
  // The row, in px times `factor`.
  RigRow row(int y, double factor) const;

  PosePattern pattern_;
  PoseVector variance_{};  // of rotations and scale; 0 for the baseline, which only moves matches across the rows
  double focal_baseline_;
  double limit_px_;
  bool adds_ = false;
};

}  // namespace endosdk
