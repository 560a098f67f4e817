// How far a rig stands from its calibration, from what is left across the rows of a rectified pair.
//
// A right camera that turned a little, or a baseline that points elsewhere, moves matches off their rows in a pattern of its
// own: a turn about x by a constant, about y by x * y, about z by x, a baseline by the disparity. The fit is robust, and its
// covariance is that of errors which hold together over large parts of the picture.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "geometry/linear.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {

// Turns of the right camera about x, y and z, then the directions of the baseline down and forward, radians.
constexpr int pose_terms = fit_terms;
constexpr double certain_errors = 4.0;  // standard errors from which a measure is no chance
constexpr double degrees_per_radian = 57.29577951308232;
using PoseVector = std::array<double, pose_terms>;
using PoseMatrix = std::array<double, pose_terms * pose_terms>;

// The rectified geometry that the pattern needs, px. Disparities come without `doffs`.
struct PosePattern {
  double focal_x = 0.0;
  double focal_y = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  double doffs = 0.0;
  bool calibrated = false;  // else the focal length is a stand-in, and angles mean nothing

  // Rows, px, by which the match of (x, y) at this disparity lies lower, per radian of each term.
  std::array<float, pose_terms> rows(float x, float y, float disparity) const {
    const auto metric = static_cast<float>(static_cast<double>(disparity) + doffs);
    const auto fy = static_cast<float>(focal_y);
    const float per_focal = metric / static_cast<float>(focal_x);
    const float u = (x - static_cast<float>(cx)) / static_cast<float>(focal_x) - per_focal;  // of the right view
    const float v = (y - static_cast<float>(cy)) / fy;
    return {-fy * (1.0f + v * v), fy * u * v, fy * u, fy * per_focal, -fy * v * per_focal};
  }

  // The same of a whole turn, which along one row of pixels is linear in x and the disparity.
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
  double vertical_px = 0.0;  // vertical disparity: root mean square of the pattern where it was measured
  double vertical_se_px = 0.0;
  double mean_vertical_px = 0.0;  // of the same pattern, with its sign: matches lie lower where it is positive

  double standard_error(int term) const;

  // The turns about those axes about which chance does not explain them, 0 about the others. One axis that the picture
  // hardly shows must neither hide what is certain about another one, nor add to it.
  PoseVector certain_turns() const;
};

// What was measured of one pair. Keeps its memory between frames.
class PoseMeasurements {
 public:
  void resize(int count);

  // Where measurements are written, from one of them on. `rest`: px that are left across the rows; a weight of 0: nothing was
  // measured here, and the rest must be numbers all the same. `block`: below pose_blocks, the part of the picture.
  struct Span {
    std::array<float*, pose_terms> rows;
    float* rest;
    float* weight;
    int* block;
  };
  Span from(int first);

  // Adds to the value what the measurements tell. False where they are too few.
  bool refine(PoseVector& value);

  // The covariance of the latest refine().
  void finish(PoseError& error) const;

 private:
  void choose(size_t measured);
  double scatter(const PoseVector& step);
  void add_up(const PoseVector& step, Robust robust, double limit, PoseMatrix& normal, PoseVector& side) const;
  float left_over(size_t i, const PoseVector& step) const;

  std::array<std::vector<float>, pose_terms> rows_;
  std::vector<float> rest_;
  std::vector<float> weight_;
  std::vector<int> block_;
  std::vector<size_t> chosen_;  // what the scatter is taken from
  std::vector<float> sorted_;
  PoseVector step_{};
  PoseMatrix normal_{};
  double variance_ = 0.0;
  double tuned_ = 0.0;
};

constexpr int pose_blocks_across = 8;
constexpr int pose_blocks_down = 6;
constexpr int pose_blocks = pose_blocks_across * pose_blocks_down;

// Length of the three turns, radians.
double turn_length(const PoseVector& value);

// Rotation of the right camera by the three turns.
Mat3 turn_of(const PoseVector& value);

}  // namespace endosdk
