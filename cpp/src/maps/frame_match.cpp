#include "maps/frame_match.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/median.hpp"
#include "maps/ramp.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

// Differences of the pictures, in units of their median. Up to `alike` a pixel counts in full, from `unlike` on it does not
// count.
constexpr float alike = 2.5f, unlike = 5.0f;
constexpr float least_noise = 0.5f, most_noise = 4.0f;  // grey levels
constexpr float cut = 16.0f;  // if half of the picture differs by more, the scene has changed

constexpr int rows_per_block = 16;
constexpr int red = 0;  // the channel

bool is_inside(Size size, float x, float y) {
  return x >= -0.5f && x <= static_cast<float>(size.width) - 0.5f && y >= -0.5f && y <= static_cast<float>(size.height) - 0.5f;
}

}  // namespace

bool FrameMatch::next(const PlanarView& left, Size picture) {
  now_ = 1 - now_;
  views_[now_].read(left, picture);
  red_[now_].resize(views_[now_].level(0).size);
  read_means(left, red, views_[now_].unit(), red_[now_]);
  const Size now = views_[now_].level(0).size;
  const Size before = views_[1 - now_].level(0).size;
  if (now.width != before.width || now.height != before.height) return false;
  if (std::min(now.width, now.height) < ImageMotion::patch) return false;
  motion_.find(views_[now_], views_[1 - now_]);
  compare();
  return true;
}

void FrameMatch::compare() {
  const Gains gains = read_residuals();
  smooth_residuals();
  sorted_ = residual_;
  const float typical = median(sorted_);
  if (typical > cut) {
    std::fill(agreement_.begin(), agreement_.end(), 0.0f);
    return;
  }
  const float noise = std::clamp(typical, least_noise, most_noise);
  const Size size = this->size();
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

FrameMatch::Gains FrameMatch::read_residuals() {
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
  // A camera may change its exposure and white balance at every frame.
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
  return gains;
}

void FrameMatch::smooth_residuals() {
  const Size size = this->size();
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
  residual_.swap(sorted_);
}

float FrameMatch::difference_at(int x, int y, ImageMotion::Shift shift, const Gains& gains) const {
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

// At the edge of a tool, the motions of both sides are mixed. There a pixel takes the motion of a nearby patch if this motion
// explains the picture better.
float FrameMatch::find_better(int x, int y, const Gains& gains, float residual) {
  const Size size = this->size();
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

}  // namespace endosdk
