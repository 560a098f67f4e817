#include "maps/disparity_change.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/median.hpp"
#include "maps/image_motion.hpp"
#include "maps/ramp.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int block = 8;  // cells along a side
constexpr int rows_per_task = 16;

// The change that a moving camera makes has five terms: a constant, d, d x, d y and d^2, from motion along and rotation about
// each axis. The fit over the blocks is repeated, each time without the blocks that disagree. Near surfaces influence such a
// fit more than far ones. A tool is near, so near surfaces count less.
constexpr float disparity_unit = 32.0f;
constexpr int fit_passes = 6;
constexpr float fit_reach = 3.0f;                        // in units of the median residual
constexpr float least_reach = 0.01f, most_reach = 3.0f;  // network pixels
constexpr float least_weight = 8.0f;                     // blocks below are not fitted: few cells that agree say little
constexpr double fit_ridge = 1.0;
constexpr float leverage = 5.0f;

// An alpha-beta filter makes the rate follow the fit, so that a noisy fit changes the rate little. In still scenes fits are
// 0.02 px in size, by noise alone. A change far above `fit_noise` is a motion that the rate did not foresee, after frames that
// were left out for example. It counts in full.
constexpr float change_gain = 0.5f, rate_gain = 0.3f;
constexpr float fit_noise = 0.06f;  // network pixels

// Neighbouring blocks of one surface may share a difference, such as that of a tool that comes nearer. It counts as a change as
// far as it exceeds this share of the expected error. The part below is taken for noise.
constexpr float shared_share = 0.1f;
constexpr float same_surface = 2.0f;  // network pixels between two blocks; blocks twice as far apart share nothing
constexpr float block_ridge = 4.0f;  // cells with an error of 1: blocks in which few cells agree change little

float centred(int place, int count) { return static_cast<float>(2 * place + 1) / static_cast<float>(count) - 1.0f; }

}  // namespace

void DisparityChange::follow(const ChangingMaps& maps, MutableFloatView moved) {
  const FloatView before = {moved.data, moved.width, moved.height};
  sum_blocks(maps, before);
  follow_camera(moved);
  sum_blocks(maps, before);
  follow_tools(moved);
}

void DisparityChange::sum_blocks(const ChangingMaps& maps, const FloatView& moved) {
  const Size size = {moved.width, moved.height};
  grid_ = {(size.width + block - 1) / block, (size.height + block - 1) / block};
  blocks_.assign(count_of(grid_), {});
  const auto sum_rows = [&](int begin, int end, int) {
    for (int y = begin * block; y < std::min(end * block, size.height); ++y) {
      for (int x = 0; x < size.width; ++x) {
        const auto i = static_cast<size_t>(y * size.width + x);
        const float error = maps.error.data[i];
        const float difference = maps.now.data[i] - moved.data[i];
        const float weight = maps.gate.data[i] * ramp(std::abs(difference), agreeing * error, disagreeing * error) / error;
        if (!(weight > 0.0f)) continue;
        Block& sums = blocks_[static_cast<size_t>(y / block * grid_.width + x / block)];
        sums.weight += weight;
        sums.difference += weight * difference;
        sums.error += weight * error;
        sums.moved += weight * moved.data[i];
        sums.x += weight * centred(x, size.width);
        sums.y += weight * centred(y, size.height);
      }
    }
  };
  parallel_for(grid_.height, 1, sum_rows);
}

void DisparityChange::follow_camera(MutableFloatView moved) {
  // All that any frame of this size can need, so that later ones allocate nothing.
  samples_.reserve(blocks_.size());
  left_over_.reserve(blocks_.size());
  sorted_.reserve(blocks_.size());
  samples_.clear();
  for (const Block& one : blocks_) {
    if (one.weight < least_weight) continue;
    const Terms values = terms_of(one.moved / one.weight, one.x / one.weight, one.y / one.weight);
    const float difference = one.difference / one.weight - sum(rate_, values);
    samples_.push_back({values, difference, one.weight / (1.0f + leverage * sum(values, values))});
  }
  if (samples_.empty()) {
    begin_anew();
    return;
  }
  const Terms found = fitted_change();
  const float square = mean_square(found);
  const float gain = std::max(change_gain, square / (square + fit_noise * fit_noise));
  Terms change{};
  for (size_t i = 0; i < terms; ++i) {
    change[i] = rate_[i] + gain * found[i];
    rate_[i] += rate_gain * found[i];
  }
  const auto add_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < moved.width; ++x) {
        float& one = moved.data[static_cast<size_t>(y * moved.width + x)];
        one += sum(change, terms_of(one, centred(x, moved.width), centred(y, moved.height)));
      }
    }
  };
  parallel_for(moved.height, rows_per_task, add_rows);
}

// Mean square of a change over the samples.
float DisparityChange::mean_square(const Terms& change) const {
  float squares = 0.0f, weights = 0.0f;
  for (const Sample& one : samples_) {
    const float value = sum(change, one.values);
    squares += one.weight * value * value;
    weights += one.weight;
  }
  return squares / weights;
}

// The change that the samples share, beyond the rate.
DisparityChange::Terms DisparityChange::fitted_change() {
  Terms change{};
  left_over_.resize(samples_.size());
  for (int pass = 0; pass < fit_passes; ++pass) {
    for (size_t k = 0; k < samples_.size(); ++k) left_over_[k] = samples_[k].difference - sum(change, samples_[k].values);
    const float reach = std::clamp(fit_reach * median_size(left_over_), least_reach, most_reach);
    Matrix system{};
    for (size_t i = 0; i < terms; ++i) system[i][i] = fit_ridge;
    for (size_t k = 0; k < samples_.size(); ++k) {
      const float far = left_over_[k] / reach;
      const float kept = std::max(0.0f, 1.0f - far * far);
      const double weight = static_cast<double>(samples_[k].weight * kept * kept);
      for (size_t row = 0; row < terms; ++row) {
        const double weighted = weight * static_cast<double>(samples_[k].values[row]);
        for (size_t column = row; column < terms; ++column) {
          system[row][column] += weighted * static_cast<double>(samples_[k].values[column]);
        }
        system[row][terms] += weighted * static_cast<double>(samples_[k].difference);
      }
    }
    for (size_t row = 0; row < terms; ++row) {
      for (size_t column = 0; column < row; ++column) system[row][column] = system[column][row];
    }
    change = solve(system);
  }
  return change;
}

void DisparityChange::follow_tools(MutableFloatView moved) {
  changes_.resize(blocks_.size());
  for (int y = 0; y < grid_.height; ++y) {
    for (int x = 0; x < grid_.width; ++x) {
      const Block around = sums_around(x, y);
      const auto i = static_cast<size_t>(y * grid_.width + x);
      const float shared = around.difference / (around.weight + block_ridge);
      const float noise = shared_share * around.error / (around.weight + block_ridge);
      changes_[i] = std::copysign(std::max(0.0f, std::abs(shared) - noise), shared);
    }
  }
  const Size size = {moved.width, moved.height};
  const auto add_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      const float at_y = (static_cast<float>(y) + 0.5f) / block - 0.5f;
      for (int x = 0; x < size.width; ++x) {
        moved.data[static_cast<size_t>(y * size.width + x)] +=
            sample_bilinear({changes_.data(), grid_.width, grid_.height}, (static_cast<float>(x) + 0.5f) / block - 0.5f, at_y);
      }
    }
  };
  parallel_for(size.height, rows_per_task, add_rows);
}

// Sums over the neighbouring blocks of the same surface only: the tissue around a thin tool must not hold it back.
DisparityChange::Block DisparityChange::sums_around(int x, int y) const {
  const Block& own = blocks_[static_cast<size_t>(y * grid_.width + x)];
  if (!(own.weight > 0.0f)) return {};
  Block all;
  for (int dy = -1; dy <= 1; ++dy) {
    const int row = std::clamp(y + dy, 0, grid_.height - 1);
    for (int dx = -1; dx <= 1; ++dx) {
      const Block& one = blocks_[static_cast<size_t>(row * grid_.width + std::clamp(x + dx, 0, grid_.width - 1))];
      if (!(one.weight > 0.0f)) continue;
      const float apart = std::abs(one.moved / one.weight - own.moved / own.weight);
      const float share = ramp(apart, same_surface, 2.0f * same_surface);
      all.weight += share * one.weight;
      all.difference += share * one.difference;
      all.error += share * one.error;
    }
  }
  return all;
}

float DisparityChange::median_size(const std::vector<float>& values) {
  sorted_.resize(values.size());
  for (size_t i = 0; i < values.size(); ++i) sorted_[i] = std::abs(values[i]);
  return median(sorted_);
}

DisparityChange::Terms DisparityChange::terms_of(float disparity, float x, float y) {
  const float d = disparity / disparity_unit;
  return {1.0f, d, d * x, d * y, d * d};
}

float DisparityChange::sum(const Terms& weights, const Terms& values) {
  float result = 0.0f;
  for (size_t i = 0; i < terms; ++i) result += weights[i] * values[i];
  return result;
}

// Solves a symmetric positive system in place; its last column is the right-hand side.
DisparityChange::Terms DisparityChange::solve(Matrix& m) {
  for (size_t i = 0; i < terms; ++i) {
    for (size_t row = i + 1; row < terms; ++row) {
      const double share = m[row][i] / m[i][i];
      for (size_t k = i; k <= terms; ++k) m[row][k] -= share * m[i][k];
    }
  }
  Terms found{};
  std::array<double, terms> exact{};
  for (size_t i = terms; i-- > 0;) {
    double value = m[i][terms];
    for (size_t k = i + 1; k < terms; ++k) value -= m[i][k] * exact[k];
    exact[i] = value / m[i][i];
    found[i] = static_cast<float>(exact[i]);
  }
  return found;
}

}  // namespace endosdk
