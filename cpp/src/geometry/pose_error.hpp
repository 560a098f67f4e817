// The pose error: how far a rig is from its calibration. It is fitted to the vertical disparity of a rectified pair.
//
// Each small rotation of the right camera, or of the baseline, moves matches off their rows in its own pattern. A rotation
// about x moves them by a constant, about y by x * y, about z by x, and a rotation of the baseline by the disparity. A right view
// of another scale, for example by its zoom, moves them by y. The fit is robust. Its covariance assumes errors that are correlated
// over large parts of the picture.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "geometry/linear.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {

// Terms: rotations of the right camera about x, y and z, then of the baseline down and forward, all in radians. Then the scale
// of the right view against the left one, less 1.
constexpr int pose_terms = fit_terms;
constexpr size_t scale_term = 5;
constexpr double certain_errors = 4.0;  // standard errors; a larger value is not taken for chance
constexpr double degrees_per_radian = 57.29577951308232;
using PoseVector = std::array<double, pose_terms>;
using PoseMatrix = std::array<double, pose_terms * pose_terms>;

// The rectified geometry that the patterns need, px. Disparities are given without `doffs`.
struct PosePattern {
  double focal_x = 0.0;
  double focal_y = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  double doffs = 0.0;
  bool calibrated = false;  // false: a usual focal length is assumed, and angles mean nothing

  // Rows, px, by which the match of (x, y) with this disparity lies lower, per unit of each term.
  std::array<float, pose_terms> rows(float x, float y, float disparity) const {
    const auto metric = static_cast<float>(static_cast<double>(disparity) + doffs);
    const auto fy = static_cast<float>(focal_y);
    const float per_focal = metric / static_cast<float>(focal_x);
    const float u = (x - static_cast<float>(cx)) / static_cast<float>(focal_x) - per_focal;  // in the right view
    const float v = (y - static_cast<float>(cy)) / fy;
    return {-fy * (1.0f + v * v), fy * u * v, fy * u, fy * per_focal, -fy * v * per_focal, fy * v};
  }

  // The same rows for given values of all terms together. Along one row of pixels they are linear in x and the disparity.
  struct Line {
    float start;
    float per_x;
    float per_disparity;

    float at(float x, float disparity) const { return start + per_x * x + per_disparity * disparity; }
  };
  Line line(const PoseVector& value, double y) const;
};

struct PoseError {
  bool measured = false;
  PoseVector value{};
  PoseMatrix covariance{};
  double vertical_px = 0.0;  // vertical disparity: root mean square of the fitted pattern over the measured places
  double vertical_se_px = 0.0;
  double mean_vertical_px = 0.0;  // mean of the same pattern, with its sign; positive: matches lie lower

  double standard_error(int term) const;

  // The rotations that chance does not explain, and 0 about the other axes. An axis about which the picture tells little must
  // neither hide a certain rotation about another axis, nor add to it.
  PoseVector certain_turns() const;

  // The scale of the right view against the left one, less 1; 0 where chance explains it.
  double certain_scale() const;
};

// The measurements of one pair. It keeps its memory between frames.
class PoseMeasurements {
 public:
  void resize(int count);

  // Memory for measurements, from a given one on. `rest` is the vertical disparity, px, that is left. A weight of 0 means that
  // nothing was measured; the other values must be finite all the same. `block` is the part of the picture, below pose_blocks.
  struct Span {
    std::array<float*, pose_terms> rows;
    float* rest;
    float* weight;
    int* block;
  };
  Span from(int first);

  // Adds to `value` the correction that the measurements give. Returns false if they are too few.
  bool refine(PoseVector& value);

  // Completes the error after the last refine(): its covariance and the vertical disparity.
  void finish(PoseError& error) const;

  // The vertical disparity that the last refine() leaves, NaN where nothing was measured.
  void left_over(std::vector<float>& rest) const;

 private:
  void choose(size_t measured);
  double scatter(const PoseVector& step);
  void add_up(const PoseVector& step, Robust robust, double limit, PoseMatrix& normal, PoseVector& side) const;
  float left_over(size_t i, const PoseVector& step) const;

  std::array<std::vector<float>, pose_terms> rows_;
  std::vector<float> rest_;
  std::vector<float> weight_;
  std::vector<int> block_;
  std::vector<size_t> chosen_;  // measurements from which the scatter is computed
  std::vector<float> sorted_;
  PoseVector step_{};
  PoseMatrix normal_{};
  double variance_ = 0.0;
  double tuned_ = 0.0;
};

constexpr int pose_blocks_across = 8;
constexpr int pose_blocks_down = 6;
constexpr int pose_blocks = pose_blocks_across * pose_blocks_down;

// Angle of the three rotations together, radians.
double turn_length(const PoseVector& value);

// Rotation matrix of the right camera.
Mat3 turn_of(const PoseVector& value);

}  // namespace endosdk
