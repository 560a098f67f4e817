// The vertical disparity of a matched pair, and what it tells about the rig. One Lucas-Kanade step along y, at the found
// disparity, measures it in windows all over the picture. Then the pose error that explains these measurements is fitted.
#pragma once

#include <vector>

#include "geometry/pose_error.hpp"
#include "images/resize.hpp"
#include "maps/matched_views.hpp"
#include "maps/row_misfit.hpp"

namespace endosdk {

// A cell counts from this confidence of the network on.
constexpr float row_disparity_confidence = 0.5f;

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class RowDisparity {
 public:
  // Windows are three rows of three cells. Bands of them, and windows of a band, lie so many cells apart.
  static constexpr int band_period = 6;
  static constexpr int cells_along = 2;

  // `frame` is in frame pixels per pixel of the views. `grid` is in cells of the confidence per pixel of the views.
  const PoseError& measure(const MatchedViews& views, const FloatView& confidence, Scale grid, Scale frame,
                           const PosePattern& pattern);

  const PoseError& latest() const { return error_; }

  // Where the latest error does not explain the measurements.
  const RowMisfit& misfit() const { return misfit_; }

 private:
  void measure_band(int band, int first, int worker);
  void find_wanted(const FloatView& confidence, Scale grid);
  void pass(int every);
  float* scratch_of(int worker) { return scratch_.data() + static_cast<ptrdiff_t>(worker) * scratch_size_; }

  const MatchedViews* views_ = nullptr;
  PosePattern pattern_;
  Scale column_;  // frame px per column and per row of brightness
  int bands_ = 0;
  int along_ = 0;  // windows per band
  float flat_ = 0.0f;
  int scratch_size_ = 0;
  PoseMeasurements measurements_;
  std::vector<float> wanted_;  // three rows per band
  std::vector<int> columns_;  // column of the confidence for each cell
  std::vector<float> scratch_;  // per worker
  PoseError error_;
  std::vector<float> rest_;
  RowMisfit misfit_;
};

}  // namespace endosdk
