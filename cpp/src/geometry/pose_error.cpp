#include "geometry/pose_error.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "geometry/median.hpp"

namespace endosdk {
namespace {

// Prior knowledge, in the units of the terms: cameras rotate by a few degrees at most. A baseline keeps its direction to half a
// degree, because only a bent shaft changes it. Views of one rig have the same scale to a few hundredths.
constexpr PoseVector prior_deviation = {0.1, 0.1, 0.1, 0.01, 0.01, 0.03};

constexpr int least_measurements = 100;
constexpr int least_blocks = 6;
constexpr int rounds = 3;            // rounds of reweighting
constexpr size_t most_sorted = 512;  // values from which the scatter is computed
constexpr double least_scatter = 0.02;  // px
constexpr double normal_law = 1.4826;   // standard deviation per median of the absolute values
constexpr double huber = 1.345;         // standard deviations; the usual choices
constexpr double tukey = 4.685;

// Errors that the whole picture has in common, so that its blocks cannot show them. They were measured on rendered pairs with
// known rotation, see tests/core/test_pose_error.py.
constexpr PoseVector common_factor = {1.1, 2.0, 1.5, 2.0, 2.0, 2.0};
constexpr double common_share = 0.03;  // share of the value itself
constexpr double common_floor = 1e-4;  // units of the terms

double prior_of(size_t term) { return 1.0 / (prior_deviation[term] * prior_deviation[term]); }

double cut_weight(double share) {
  const double left = 1.0 - share * share;
  return share < 1.0 ? left * left : 0.0;
}

}  // namespace

PosePattern::Line PosePattern::line(const PoseVector& value, double y) const {
  const double v = (y - cy) / focal_y;
  const double per_u = focal_y * (value[1] * v + value[2]);
  const double per_focal = focal_y * (value[3] - value[4] * v) - per_u;
  const double start = focal_y * (v * value[scale_term] - (1.0 + v * v) * value[0]) - per_u * cx / focal_x + per_focal * doffs / focal_x;
  return {static_cast<float>(start), static_cast<float>(per_u / focal_x), static_cast<float>(per_focal / focal_x)};
}

double PoseError::standard_error(int term) const {
  return std::sqrt(covariance[static_cast<size_t>(term) * (pose_terms + 1)]);
}

PoseVector PoseError::certain_turns() const {
  PoseVector turns{};
  for (int i = 0; i < 3; ++i) {
    const double turn = value[static_cast<size_t>(i)];
    if (std::abs(turn) > certain_errors * standard_error(i)) turns[static_cast<size_t>(i)] = turn;
  }
  return turns;
}

double PoseError::certain_scale() const {
  const double scale = value[scale_term];
  return std::abs(scale) > certain_errors * standard_error(scale_term) ? scale : 0.0;
}

void PoseMeasurements::resize(int count) {
  const auto size = static_cast<size_t>((count + fit_lanes - 1) / fit_lanes * fit_lanes);
  for (auto& term : rows_) term.resize(size);
  rest_.resize(size);
  weight_.assign(size, 0.0f);
  block_.resize(size);
  chosen_.reserve(most_sorted + 1);
  sorted_.reserve(most_sorted + 1);
}

PoseMeasurements::Span PoseMeasurements::from(int first) {
  Span span{{}, rest_.data() + first, weight_.data() + first, block_.data() + first};
  for (size_t t = 0; t < pose_terms; ++t) span.rows[t] = rows_[t].data() + first;
  return span;
}

float PoseMeasurements::left_over(size_t i, const PoseVector& step) const {
  float rest = rest_[i];
  for (size_t t = 0; t < pose_terms; ++t) rest -= static_cast<float>(step[t]) * rows_[t][i];
  return rest;
}

// Chooses the measurements from which the scatter is computed, at regular distances. It runs once per fit; all rounds use the
// same measurements.
void PoseMeasurements::choose(size_t measured) {
  const size_t every = measured / most_sorted + 1;
  chosen_.clear();
  size_t next = 0;
  size_t seen = 0;
  for (size_t i = 0; i < weight_.size(); ++i) {
    if (!(weight_[i] > 0.0f) || seen++ != next) continue;
    chosen_.push_back(i);
    next += every;
  }
}

// Robust standard deviation of the residuals after a step.
double PoseMeasurements::scatter(const PoseVector& step) {
  sorted_.clear();
  for (const size_t i : chosen_) sorted_.push_back(std::abs(left_over(i, step)));
  return std::max(normal_law * static_cast<double>(median(sorted_)), least_scatter);
}

void PoseMeasurements::add_up(const PoseVector& step, Robust robust, double limit, PoseMatrix& normal, PoseVector& side) const {
  std::array<double, fit_sums> sums;
  FitSums fit{};
  for (size_t t = 0; t < pose_terms; ++t) {
    fit.terms[t] = rows_[t].data();
    fit.step[t] = static_cast<float>(step[t]);
  }
  fit.rest = rest_.data();
  fit.weight = weight_.data();
  fit.count = static_cast<int>(rest_.size());
  fit.limit = static_cast<float>(limit);
  fit.robust = robust;
  fit.sums = sums.data();
  kernels().add_up_fit(fit);
  const double* sum = sums.data();
  for (size_t t = 0; t < pose_terms; ++t) {
    for (size_t k = 0; k <= t; ++k) normal[t * pose_terms + k] = normal[k * pose_terms + t] = *sum++;
  }
  std::copy_n(sum, pose_terms, side.begin());
}

bool PoseMeasurements::refine(PoseVector& value) {
  const auto measured = std::count_if(weight_.begin(), weight_.end(), [](float w) { return w > 0.0f; });
  if (measured < least_measurements) return false;
  std::array<bool, pose_blocks> seen{};
  for (size_t i = 0; i < weight_.size(); ++i) {
    if (weight_[i] > 0.0f) seen[static_cast<size_t>(block_[i])] = true;
  }
  if (std::count(seen.begin(), seen.end(), true) < least_blocks) return false;
  choose(static_cast<size_t>(measured));
  PoseVector step{};
  for (int round = 0; round < rounds; ++round) {
    tuned_ = scatter(step);
    variance_ = tuned_ * tuned_;
    PoseVector side;
    const bool cut = round > 0;
    add_up(step, cut ? Robust::tukey : Robust::huber, (cut ? tukey : huber) * tuned_, normal_, side);
    for (size_t t = 0; t < pose_terms; ++t) {
      side[t] = side[t] / variance_ - prior_of(t) * value[t];
      for (size_t k = 0; k < pose_terms; ++k) normal_[t * pose_terms + k] /= variance_;
      normal_[t * pose_terms + t] += prior_of(t);
    }
    step = multiply(inverse(normal_), side);
  }
  step_ = step;
  for (size_t t = 0; t < pose_terms; ++t) value[t] += step[t];
  return true;
}

void PoseMeasurements::finish(PoseError& error) const {
  std::array<PoseVector, pose_blocks> pulls{};
  std::array<bool, pose_blocks> seen{};
  for (size_t i = 0; i < rest_.size(); ++i) {
    if (weight_[i] <= 0.0f) continue;
    const double rest = static_cast<double>(left_over(i, step_));
    const double pull = cut_weight(std::abs(rest) / (tukey * tuned_)) * static_cast<double>(weight_[i]) * rest / variance_;
    const auto block = static_cast<size_t>(block_[i]);
    seen[block] = true;
    for (size_t t = 0; t < pose_terms; ++t) pulls[block][t] += pull * static_cast<double>(rows_[t][i]);
  }
  const auto blocks = static_cast<double>(std::count(seen.begin(), seen.end(), true));
  PoseMatrix middle{};
  for (const PoseVector& pull : pulls) {
    for (size_t t = 0; t < pose_terms; ++t) {
      for (size_t k = 0; k < pose_terms; ++k) middle[t * pose_terms + k] += blocks / (blocks - 1.0) * pull[t] * pull[k];
    }
  }
  for (size_t t = 0; t < pose_terms; ++t) middle[t * (pose_terms + 1)] += prior_of(t);
  const PoseMatrix inverted = inverse(normal_);
  error.covariance = multiply(multiply(inverted, middle), inverted);
  for (size_t t = 0; t < pose_terms; ++t) {
    for (size_t k = 0; k < pose_terms; ++k) error.covariance[t * pose_terms + k] *= common_factor[t] * common_factor[k];
  }
  for (size_t t = 0; t < pose_terms; ++t) {
    const double common = common_share * error.value[t];
    error.covariance[t * (pose_terms + 1)] += common * common + common_floor * common_floor;
  }
  PoseMatrix products;
  PoseVector sums;
  add_up(step_, Robust::none, 1.0, products, sums);
  const auto count = static_cast<double>(std::count_if(weight_.begin(), weight_.end(), [](float w) { return w > 0.0f; }));
  double square = 0.0, mean = 0.0, variance = 0.0;
  for (size_t t = 0; t < pose_terms; ++t) {
    mean += error.value[t] * sums[t];
    for (size_t k = 0; k < pose_terms; ++k) {
      square += error.value[t] * error.value[k] * products[t * pose_terms + k];
      variance += error.covariance[t * pose_terms + k] * products[t * pose_terms + k];
    }
  }
  error.vertical_px = std::sqrt(square / count);
  error.vertical_se_px = std::sqrt(variance / count);
  error.mean_vertical_px = mean / count;
}

void PoseMeasurements::left_over(std::vector<float>& rest) const {
  rest.resize(rest_.size());
  for (size_t i = 0; i < rest.size(); ++i) {
    rest[i] = weight_[i] > 0.0f ? left_over(i, step_) : std::numeric_limits<float>::quiet_NaN();
  }
}

double turn_length(const PoseVector& value) { return std::sqrt(value[0] * value[0] + value[1] * value[1] + value[2] * value[2]); }

Mat3 turn_of(const PoseVector& value) { return rotation_matrix({value[0], value[1], value[2]}); }

}  // namespace endosdk
