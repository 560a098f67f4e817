#include "geometry/pose_filter.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

// Consecutive frames show the same tissue, so this many of them tell as much as one independent frame.
constexpr double alike_frames = 4.0;
constexpr double fading_view = 1.0 - 1.0 / alike_frames;

// Frames of one view of the tissue are all wrong in the same way. However many they are, they count as one independent frame,
// with the value of the latest ones. Older views fade.
constexpr double fading = 1.0 - 1.0 / 150.0;  // per view

constexpr double usual_surprise = 3.0;  // standard errors; a frame that is farther from the filtered value counts less
constexpr double harmless = 0.0017;     // radians, a tenth of a degree
constexpr double least_correction = 0.0005;
constexpr double longest_correction = 0.0017;

// Distance between a frame's rotations and the filtered ones, in standard errors.
double surprise(const PoseError& error, const PoseVector& value, const PoseError& before) {
  double most = 0.0;
  for (size_t i = 0; i < 3; ++i) {
    const size_t at = i * (pose_terms + 1);
    const double off = value[i] - before.value[i];
    most = std::max(most, std::abs(off) / std::sqrt(error.covariance[at] + before.covariance[at]));
  }
  return most;
}

}  // namespace

void PoseFilter::Evidence::add(const Evidence& other, double counts) {
  for (size_t i = 0; i < information.size(); ++i) information[i] += counts * other.information[i];
  for (size_t i = 0; i < pull.size(); ++i) pull[i] += counts * other.pull[i];
}

void PoseFilter::Evidence::fade(double factor) {
  for (double& value : information) value *= factor;
  for (double& value : pull) value *= factor;
}

void PoseFilter::add(const PoseError& error, const PoseVector& corrected, bool new_view) {
  if (!error.measured) return;
  PoseVector value = error.value;
  for (size_t i = 0; i < pose_terms; ++i) value[i] += corrected[i];
  double counts = 1.0 / alike_frames;
  if (value_.measured) counts *= std::min(1.0, usual_surprise / std::max(1e-9, surprise(error, value, value_)));
  if (new_view) {
    former_views_.fade(fading);
    former_views_.add(view_, 1.0);
    view_ = {};
  }
  const PoseMatrix sure = inverse(error.covariance);
  view_.fade(fading_view);
  view_.add({sure, multiply(sure, value)}, counts);
  Evidence all = former_views_;
  all.add(view_, 1.0);
  value_.covariance = inverse(all.information);
  value_.value = multiply(value_.covariance, all.pull);
  value_.vertical_px = error.vertical_px;
  value_.vertical_se_px = error.vertical_se_px;
  value_.measured = true;
  ++frames_;
}

bool has_drifted(const PoseError& steady) { return steady.measured && turn_length(steady.certain_turns()) > harmless; }

std::optional<PoseVector> next_correction(const PoseVector& before, const PoseError& steady) {
  PoseError left = steady;
  for (size_t i = 0; i < 3; ++i) left.value[i] -= before[i];
  const PoseVector missing = left.certain_turns();
  const double length = turn_length(missing);
  if (!steady.measured || length <= least_correction) return std::nullopt;
  const double share = std::min(1.0, longest_correction / length);
  PoseVector next = before;
  for (size_t i = 0; i < 3; ++i) next[i] += share * missing[i];
  return next;
}

}  // namespace endosdk
