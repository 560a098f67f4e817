#include "maps/temporal_filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "platform/threads.hpp"

namespace endosdk {
namespace {

// Both disparities count by their variance, as in a Kalman filter: that of a frame follows from the network's confidence, that
// of the frame before from all that went into it, and from this share of the frame's own for what may have changed.
constexpr float drift = 0.02f;
constexpr float least_share = 0.1f;  // of a frame's own disparity, so that a wrong one is forgotten

// Differences of the pictures, in units of their median, up to which a former disparity counts in full, and from which on it
// does not count.
constexpr float alike = 2.5f, unlike = 5.0f;
constexpr float least_noise = 0.5f, most_noise = 4.0f;  // grey levels
constexpr float cut = 16.0f;  // where half of the picture differs by more, it is another scene

// The same for differences of disparity, in units of the error to be expected. They are wide: where the pictures agree, most of
// what differs is an error of the network.
constexpr float agreeing = 8.0f, disagreeing = 16.0f;
constexpr float least_error = 0.8f, most_error = 6.0f;  // network pixels

// A difference that a neighbourhood of three by three blocks shares is a change, such as of a tool that comes nearer, as far as
// it is above this share of the error to be expected, and above so many times what is usual in the frame. What is below is
// taken for noise.
constexpr int block = 8;  // cells
constexpr float shared_share = 0.1f;
constexpr float unusual = 2.0f;
constexpr float whole_share = 0.05f;  // the same of what the whole picture shares
constexpr float block_ridge = 4.0f;  // cells of an error of 1: blocks with few that agree change little

// The change of disparity that camera and rig make together: a constant, and what moving along and turning about each axis
// do, which is d, d x, d y and d^2. Fitted to every third cell, and again without those that disagree.
constexpr int terms = 5;
constexpr int fitted_step = 3;
constexpr std::array<float, 3> fit_reach = {3.0f, 2.0f, 1.0f};  // in units of the error to be expected
constexpr double fit_ridge = 1.0;
constexpr float disparity_unit = 32.0f;

constexpr int rows_per_block = 16;
constexpr int red = 0;  // the channel

using Terms = std::array<float, terms>;
using Matrix = std::array<std::array<double, terms + 1>, terms>;

Terms terms_of(float disparity, float x, float y) {
  const float d = disparity / disparity_unit;
  return {1.0f, d, d * x, d * y, d * d};
}

float sum(const Terms& weights, const Terms& values) {
  float result = 0.0f;
  for (size_t i = 0; i < terms; ++i) result += weights[i] * values[i];
  return result;
}

// Solves a symmetric positive system in place; its last column is the right-hand side.
Terms solve(Matrix& m) {
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

// Scale of a Laplace law whose probability of an error up to one network pixel is the confidence.
float expected_error(float confidence) {
  const float inside = std::clamp(confidence, 0.01f, 0.99f);
  return std::clamp(-1.0f / std::log(1.0f - inside), least_error, most_error);
}

// 1 up to `full`, 0 from `none` on, straight between.
float ramp(float value, float full, float none) { return std::clamp((none - value) / (none - full), 0.0f, 1.0f); }

bool is_inside(Size size, float x, float y) {
  return x >= -0.5f && x <= static_cast<float>(size.width) - 0.5f && y >= -0.5f && y <= static_cast<float>(size.height) - 0.5f;
}

float centred(int place, int count) { return static_cast<float>(2 * place + 1) / static_cast<float>(count) - 1.0f; }

size_t count_of(Size size) { return static_cast<size_t>(size.width) * static_cast<size_t>(size.height); }

}  // namespace

void TemporalFilter::smooth(const TemporalInput& input) {
  const Size size = {input.disparity.width, input.disparity.height};
  read_errors(input);
  now_ = 1 - now_;
  views_[now_].read(input.left, input.picture);
  red_[now_].resize(views_[now_].level(0).size);
  read_means(input.left, red, views_[now_].unit(), red_[now_]);
  const Size now = views_[now_].level(0).size;
  const Size before = views_[1 - now_].level(0).size;
  const bool fits = std::min(now.width, now.height) >= ImageMotion::patch;
  const bool alike_sizes = size.width == former_size_.width && size.height == former_size_.height &&
                           now.width == before.width && now.height == before.height;
  if (has_former_ && alike_sizes && fits) {
    motion_.find(views_[now_], views_[1 - now_]);
    compare_pictures();
    // Pixels of the reduced view per cell.
    const float unit = static_cast<float>(views_[now_].unit());
    move_former(input, {1.0 / (input.cells.y * static_cast<double>(unit)), 1.0 / (input.cells.x * static_cast<double>(unit))});
    follow_depth(input);
    follow_neighbourhoods(input);
    blend(input);
  } else {
    variance_.resize(error_.size());
    for (size_t i = 0; i < error_.size(); ++i) variance_[i] = error_[i] * error_[i];
  }
  keep(input);
}

void TemporalFilter::read_errors(const TemporalInput& input) {
  error_.resize(count_of({input.disparity.width, input.disparity.height}));
  const auto read_rows = [&](int begin, int end, int) {
    const auto first = static_cast<size_t>(begin * input.disparity.width);
    const auto last = static_cast<size_t>(end * input.disparity.width);
    for (size_t i = first; i < last; ++i) error_[i] = expected_error(input.confidence.data[i]);
  };
  parallel_for(input.disparity.height, rows_per_block, read_rows);
}

void TemporalFilter::keep(const TemporalInput& input) {
  former_size_ = {input.disparity.width, input.disparity.height};
  former_.assign(input.disparity.data, input.disparity.data + count_of(former_size_));
  has_former_ = true;
}

void TemporalFilter::compare_pictures() {
  const FloatView green = views_[now_].level(0).view(), reds = red_[now_].view();
  const FloatView green_before = views_[1 - now_].level(0).view(), red_before = red_[1 - now_].view();
  const Size size = {green.width, green.height};
  residual_.resize(count_of(size));
  moved_red_.resize(count_of(size));
  shifts_.resize(count_of(size));
  agreement_.resize(count_of(size));
  const auto move_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const auto i = static_cast<size_t>(y * size.width + x);
        const ImageMotion::Shift shift = motion_.at(static_cast<float>(x), static_cast<float>(y));
        const float from_x = static_cast<float>(x) + shift.x;
        const float from_y = static_cast<float>(y) + shift.y;
        shifts_[i] = shift;
        residual_[i] = sample_bilinear(green_before, from_x, from_y);
        moved_red_[i] = sample_bilinear(red_before, from_x, from_y);
        agreement_[i] = is_inside(size, from_x, from_y) ? 1.0f : 0.0f;
      }
    }
  };
  parallel_for(size.height, rows_per_block, move_rows);
  // A camera sets its exposure anew for every frame, and its white balance.
  const auto gain_of = [&](const FloatView& now, const std::vector<float>& before) {
    double sum_now = 0.0, sum_before = 0.0;
    for (size_t i = 0; i < before.size(); ++i) {
      sum_now += static_cast<double>(agreement_[i] * now.data[i]);
      sum_before += static_cast<double>(agreement_[i] * before[i]);
    }
    return static_cast<float>(sum_now / std::max(sum_before, 1e-6));
  };
  const Gains gains = {gain_of(green, residual_), gain_of(reds, moved_red_)};
  for (size_t i = 0; i < residual_.size(); ++i) {
    residual_[i] = std::max(std::abs(green.data[i] - gains.green * residual_[i]), std::abs(reds.data[i] - gains.red * moved_red_[i]));
  }
  sorted_.resize(count_of(size));
  const auto smoothed = [&](int x, int y) {
    float total = 0.0f;
    for (int dy = -1; dy <= 1; ++dy) {
      const int row = std::clamp(y + dy, 0, size.height - 1);
      for (int dx = -1; dx <= 1; ++dx) total += residual_[static_cast<size_t>(row * size.width + std::clamp(x + dx, 0, size.width - 1))];
    }
    return total / 9.0f;
  };
  const auto smooth_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < size.width; ++x) sorted_[static_cast<size_t>(y * size.width + x)] = smoothed(x, y);
    }
  };
  parallel_for(size.height, rows_per_block, smooth_rows);
  residual_ = sorted_;
  const auto middle = sorted_.begin() + static_cast<ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  if (*middle > cut) {
    std::fill(agreement_.begin(), agreement_.end(), 0.0f);
    return;
  }
  const float noise = std::clamp(*middle, least_noise, most_noise);
  const auto judge_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const auto i = static_cast<size_t>(y * size.width + x);
        float residual = agreement_[i] > 0.0f ? residual_[i] : std::numeric_limits<float>::infinity();
        if (residual > alike * noise) residual = find_better(x, y, gains, residual);
        agreement_[i] = ramp(residual, alike * noise, unlike * noise);
      }
    }
  };
  parallel_for(size.height, rows_per_block, judge_rows);
}

float TemporalFilter::difference_at(int x, int y, ImageMotion::Shift shift, const Gains& gains) const {
  const FloatView green = views_[now_].level(0).view(), reds = red_[now_].view();
  const FloatView green_before = views_[1 - now_].level(0).view(), red_before = red_[1 - now_].view();
  float total = 0.0f;
  for (int dy = -1; dy <= 1; ++dy) {
    const int row = std::clamp(y + dy, 0, green.height - 1);
    for (int dx = -1; dx <= 1; ++dx) {
      const int column = std::clamp(x + dx, 0, green.width - 1);
      const auto i = static_cast<size_t>(row * green.width + column);
      const float from_x = static_cast<float>(column) + shift.x, from_y = static_cast<float>(row) + shift.y;
      const float by_green = std::abs(green.data[i] - gains.green * sample_bilinear(green_before, from_x, from_y));
      total += std::max(by_green, std::abs(reds.data[i] - gains.red * sample_bilinear(red_before, from_x, from_y)));
    }
  }
  return total / 9.0f;
}

// At the edge of a tool the motions of both sides are mixed. There a pixel takes the motion of a patch nearby, if that
// explains the picture better.
float TemporalFilter::find_better(int x, int y, const Gains& gains, float residual) {
  const Size size = views_[now_].level(0).size;
  constexpr std::array<std::array<int, 2>, 13> nearby = {{{0, 0}, {-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, 1}, {1, -1}, {-1, 1},
                                                          {-2, 0}, {2, 0}, {0, -2}, {0, 2}}};
  for (const auto& [along_x, along_y] : nearby) {
    const ImageMotion::Shift shift = motion_.of_patch(x, y, along_x, along_y);
    if (!is_inside(size, static_cast<float>(x) + shift.x, static_cast<float>(y) + shift.y)) continue;
    const float found = difference_at(x, y, shift, gains);
    if (found >= residual) continue;
    residual = found;
    shifts_[static_cast<size_t>(y * size.width + x)] = shift;
  }
  return residual;
}

void TemporalFilter::move_former(const TemporalInput& input, Scale scale) {
  const Size size = {input.disparity.width, input.disparity.height};
  const Size reduced = views_[now_].level(0).size;
  const float per_x = static_cast<float>(scale.x), per_y = static_cast<float>(scale.y);
  moved_.resize(count_of(size));
  moved_variance_.resize(count_of(size));
  gate_.resize(count_of(size));
  const auto nearest = [](float place, int count) { return std::clamp(static_cast<int>(place + 0.5f), 0, count - 1); };
  const auto move_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      const float at_y = (static_cast<float>(y) + 0.5f) * per_y - 0.5f;
      for (int x = 0; x < size.width; ++x) {
        const auto i = static_cast<size_t>(y * size.width + x);
        const float at_x = (static_cast<float>(x) + 0.5f) * per_x - 0.5f;
        const auto seen = static_cast<size_t>(nearest(at_y, reduced.height) * reduced.width + nearest(at_x, reduced.width));
        const ImageMotion::Shift shift = shifts_[seen];
        const float from_x = static_cast<float>(x) + shift.x / per_x;
        const float from_y = static_cast<float>(y) + shift.y / per_y;
        moved_[i] = sample_bilinear({former_.data(), size.width, size.height}, from_x, from_y);
        moved_variance_[i] = sample_bilinear({variance_.data(), size.width, size.height}, from_x, from_y);
        gate_[i] = agreement_[seen];
      }
    }
  };
  parallel_for(size.height, rows_per_block, move_rows);
}

// Adds the change of disparity that the whole picture shares to what was moved.
void TemporalFilter::follow_depth(const TemporalInput& input) {
  const Size size = {input.disparity.width, input.disparity.height};
  Terms change{};
  for (const float reach : fit_reach) {
    Matrix system{};
    for (size_t i = 0; i < terms; ++i) system[i][i] = fit_ridge;
    for (int y = 0; y < size.height; y += fitted_step) {
      for (int x = 0; x < size.width; x += fitted_step) {
        const auto i = static_cast<size_t>(y * size.width + x);
        const Terms values = terms_of(moved_[i], centred(x, size.width), centred(y, size.height));
        const float difference = input.disparity.data[i] - moved_[i];
        const float far = (difference - sum(change, values)) / (reach * error_[i]);
        const float kept = std::max(0.0f, 1.0f - far * far);
        const double weight = static_cast<double>(gate_[i] * kept * kept);
        if (!(weight > 0.0)) continue;
        for (size_t row = 0; row < terms; ++row) {
          const double weighted = weight * static_cast<double>(values[row]);
          for (size_t column = row; column < terms; ++column) system[row][column] += weighted * static_cast<double>(values[column]);
          system[row][terms] += weighted * static_cast<double>(difference);
        }
      }
    }
    for (size_t row = 0; row < terms; ++row) {
      for (size_t column = 0; column < row; ++column) system[row][column] = system[column][row];
    }
    change = solve(system);
  }
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      float& moved = moved_[static_cast<size_t>(y * size.width + x)];
      const float found = sum(change, terms_of(moved, centred(x, size.width), centred(y, size.height)));
      const float noise = whole_share * error_[static_cast<size_t>(y * size.width + x)];
      moved += std::copysign(std::max(0.0f, std::abs(found) - noise), found);
    }
  }
}

// Adds what the cells around share of the change that is left: tools move by themselves.
void TemporalFilter::follow_neighbourhoods(const TemporalInput& input) {
  const Size size = {input.disparity.width, input.disparity.height};
  const Size blocks = {(size.width + block - 1) / block, (size.height + block - 1) / block};
  blocks_.assign(count_of(blocks), {});
  const auto sum_rows = [&](int begin, int end, int) {
    for (int y = begin * block; y < std::min(end * block, size.height); ++y) {
      for (int x = 0; x < size.width; ++x) {
        const auto i = static_cast<size_t>(y * size.width + x);
        const float difference = input.disparity.data[i] - moved_[i];
        const float weight = gate_[i] * ramp(std::abs(difference), agreeing * error_[i], disagreeing * error_[i]) / error_[i];
        if (!(weight > 0.0f)) continue;
        BlockSums& sums = blocks_[static_cast<size_t>(y / block * blocks.width + x / block)];
        sums.weight += weight;
        sums.difference += weight * difference;
        sums.error += weight * error_[i];
      }
    }
  };
  parallel_for(blocks.height, 1, sum_rows);
  changes_.resize(blocks_.size());
  limits_.resize(blocks_.size());
  for (int y = 0; y < blocks.height; ++y) {
    for (int x = 0; x < blocks.width; ++x) {
      const BlockSums around = sums_around(blocks, x, y);
      const auto i = static_cast<size_t>(y * blocks.width + x);
      changes_[i] = around.difference / (around.weight + block_ridge);
      limits_[i] = shared_share * around.error / (around.weight + block_ridge);
    }
  }
  const float limit = unusual * median_size(changes_);
  for (size_t i = 0; i < changes_.size(); ++i) {
    const float above = std::max(0.0f, std::abs(changes_[i]) - std::max(limits_[i], limit));
    changes_[i] = std::copysign(above, changes_[i]);
  }
  const auto add_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      const float at_y = (static_cast<float>(y) + 0.5f) / block - 0.5f;
      for (int x = 0; x < size.width; ++x) {
        moved_[static_cast<size_t>(y * size.width + x)] +=
            sample_bilinear({changes_.data(), blocks.width, blocks.height}, (static_cast<float>(x) + 0.5f) / block - 0.5f, at_y);
      }
    }
  };
  parallel_for(size.height, rows_per_block, add_rows);
}

TemporalFilter::BlockSums TemporalFilter::sums_around(Size blocks, int x, int y) const {
  BlockSums all;
  for (int dy = -1; dy <= 1; ++dy) {
    const int row = std::clamp(y + dy, 0, blocks.height - 1);
    for (int dx = -1; dx <= 1; ++dx) {
      const BlockSums& one = blocks_[static_cast<size_t>(row * blocks.width + std::clamp(x + dx, 0, blocks.width - 1))];
      all.weight += one.weight;
      all.difference += one.difference;
      all.error += one.error;
    }
  }
  return all;
}

float TemporalFilter::median_size(const std::vector<float>& values) {
  sorted_.resize(values.size());
  for (size_t i = 0; i < values.size(); ++i) sorted_[i] = std::abs(values[i]);
  const auto middle = sorted_.begin() + static_cast<ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  return *middle;
}

void TemporalFilter::blend(const TemporalInput& input) {
  const Size size = {input.disparity.width, input.disparity.height};
  const auto blend_rows = [&](int begin, int end, int) {
    const auto first = static_cast<size_t>(begin * size.width);
    const auto last = static_cast<size_t>(end * size.width);
    for (size_t i = first; i < last; ++i) {
      const float own = error_[i] * error_[i];
      variance_[i] = own;
      const float difference = input.disparity.data[i] - moved_[i];
      const float former = moved_variance_[i] + drift * own;
      const float error = std::sqrt(own + former);
      const float trust = gate_[i] * ramp(std::abs(difference), agreeing * error, disagreeing * error);
      if (!(trust > 0.0f)) continue;
      const float share = std::max(least_share, former / (former + own));
      input.disparity.data[i] -= (1.0f - share) * trust * difference;
      variance_[i] = own * (1.0f - trust * (1.0f - share));
    }
  };
  parallel_for(size.height, rows_per_block, blend_rows);
}

}  // namespace endosdk
