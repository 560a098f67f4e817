#include "maps/image_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/median.hpp"
#include "kernels/kernels.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int steps = 4;        // Gauss-Newton steps per level
constexpr float ridge = 64.0f;  // grey levels squared: a patch without texture keeps the shift it began with
constexpr int cells = ImageMotion::patch * ImageMotion::patch;

using Patch = std::array<float, cells>;

// Two neighbours along one axis, and the distance from the first one to the position.
struct Between {
  int first, second;
  float share;

  Between(float position, int size) {
    const float inside = std::clamp(position, 0.0f, static_cast<float>(size - 1));
    first = std::min(static_cast<int>(inside), std::max(size - 2, 0));
    second = std::min(first + 1, size - 1);
    share = inside - static_cast<float>(first);
  }
};

float blend(const FloatView& map, const Between& x, const Between& y) {
  const float* const above = map.data + static_cast<ptrdiff_t>(y.first) * map.width;
  const float* const below = map.data + static_cast<ptrdiff_t>(y.second) * map.width;
  const float upper = above[x.first] * (1.0f - x.share) + above[x.second] * x.share;
  const float lower = below[x.first] * (1.0f - x.share) + below[x.second] * x.share;
  return upper * (1.0f - y.share) + lower * y.share;
}

// Sums run down the columns of a patch first, so that the compiler can add whole rows.
using PatchRow = std::array<float, ImageMotion::patch>;

float sum_of(const PatchRow& row) {
  float sum = 0.0f;
  for (const float value : row) sum += value;
  return sum;
}

void subtract_mean(Patch& values) {
  PatchRow sums{};
  for (size_t i = 0; i < values.size(); i += sums.size()) {
    for (size_t x = 0; x < sums.size(); ++x) sums[x] += values[i + x];
  }
  const float mean = sum_of(sums) / cells;
  for (float& value : values) value -= mean;
}

float product(const Patch& a, const Patch& b) {
  PatchRow sums{};
  for (size_t i = 0; i < a.size(); i += sums.size()) {
    for (size_t x = 0; x < sums.size(); ++x) sums[x] += a[i + x] * b[i + x];
  }
  return sum_of(sums);
}

// Reads the patch whose first pixel is at (left, top), which may lie between pixels, and subtracts its mean. Outside the map
// the edge is repeated.
void read_patch(const FloatView& map, float left, float top, Patch& out) {
  constexpr int side = ImageMotion::patch + 1;
  // Every patch farther out than these limits reads the same values.
  const auto place = [](float at, int size) { return std::clamp(at, static_cast<float>(-side), static_cast<float>(size)); };
  const float x = place(left, map.width);
  const float y = place(top, map.height);
  const int column = static_cast<int>(std::floor(x));
  const int row = static_cast<int>(std::floor(y));
  const float* from = map.data + static_cast<ptrdiff_t>(row) * map.width + column;
  ptrdiff_t stride = map.width;
  std::array<float, size_t{side} * side> copy;
  if (column < 0 || row < 0 || column + side > map.width || row + side > map.height) {
    std::array<int, side> columns;
    for (int i = 0; i < side; ++i) columns[static_cast<size_t>(i)] = std::clamp(column + i, 0, map.width - 1);
    float* to = copy.data();
    for (int i = 0; i < side; ++i) {
      const float* const pixels = map.data + static_cast<ptrdiff_t>(std::clamp(row + i, 0, map.height - 1)) * map.width;
      for (const int at : columns) *to++ = pixels[at];
    }
    from = copy.data();
    stride = side;
  }
  kernels().blend_patch(from, stride, x - static_cast<float>(column), y - static_cast<float>(row), out.data());
}

// Slopes along both axes; 0 at the edges of the map.
void read_slopes(const FloatView& map, int left, int top, Patch& along_x, Patch& along_y) {
  constexpr int side = ImageMotion::patch;
  for (int v = 0; v < side; ++v) {
    const int y = top + v;
    const float* const here = map.data + static_cast<ptrdiff_t>(y) * map.width + left;
    float* const out_x = along_x.data() + static_cast<ptrdiff_t>(v) * side;
    float* const out_y = along_y.data() + static_cast<ptrdiff_t>(v) * side;
    const int first = left > 0 ? 0 : 1;
    const int end = left + side < map.width ? side : side - 1;
    out_x[0] = out_x[side - 1] = 0.0f;
    for (int u = first; u < end; ++u) out_x[u] = 0.5f * (here[u + 1] - here[u - 1]);
    const bool inside = y > 0 && y + 1 < map.height;
    for (int u = 0; u < side; ++u) out_y[u] = inside ? 0.5f * (here[u + map.width] - here[u - map.width]) : 0.0f;
  }
  subtract_mean(along_x);
  subtract_mean(along_y);
}

// Improves the shift of a patch, from its start value to where the patch was. A shift that runs away is reset to its start
// value.
void follow(const FloatView& now, const FloatView& before, int left, int top, float& shift_x, float& shift_y) {
  Patch seen, along_x, along_y, found;
  read_patch(now, static_cast<float>(left), static_cast<float>(top), seen);
  read_slopes(now, left, top, along_x, along_y);
  const float a = product(along_x, along_x) + ridge;
  const float b = product(along_x, along_y);
  const float c = product(along_y, along_y) + ridge;
  const float determinant = a * c - b * b;
  float x = shift_x, y = shift_y;
  for (int i = 0; i < steps; ++i) {
    read_patch(before, static_cast<float>(left) + x, static_cast<float>(top) + y, found);
    float of[2];
    kernels().motion_sums(found.data(), seen.data(), along_x.data(), along_y.data(), of);
    x -= (c * of[0] - b * of[1]) / determinant;
    y -= (a * of[1] - b * of[0]) / determinant;
  }
  constexpr float farthest = ImageMotion::patch / 2.0f;
  if (!(std::max(std::abs(x - shift_x), std::abs(y - shift_y)) <= farthest)) return;
  shift_x = x;
  shift_y = y;
}

void halve(const BrightnessMap& from, BrightnessMap& to) {
  to.resize({from.size.width / 2, from.size.height / 2});
  for (int y = 0; y < to.size.height; ++y) {
    const float* const above = from.values.data() + static_cast<ptrdiff_t>(2 * y) * from.size.width;
    const float* const below = above + from.size.width;
    float* const out = to.values.data() + static_cast<ptrdiff_t>(y) * to.size.width;
    for (int x = 0; x < to.size.width; ++x) {
      out[x] = 0.25f * (above[2 * x] + above[2 * x + 1] + below[2 * x] + below[2 * x + 1]);
    }
  }
}

float median_around(const std::vector<float>& values, Size size, int x, int y) {
  std::array<float, 9> around;
  size_t count = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    const int row = std::clamp(y + dy, 0, size.height - 1);
    for (int dx = -1; dx <= 1; ++dx) {
      const int column = std::clamp(x + dx, 0, size.width - 1);
      around[count++] = values[static_cast<size_t>(row) * static_cast<size_t>(size.width) + static_cast<size_t>(column)];
    }
  }
  std::nth_element(around.begin(), around.begin() + 4, around.end());
  return around[4];
}

}  // namespace

float sample_bilinear(const FloatView& map, float x, float y) {
  return blend(map, Between(x, map.width), Between(y, map.height));
}

void read_means(const PlanarView& view, int channel, int unit, BrightnessMap& out) {
  for (int y = 0; y < out.size.height; ++y) {
    float* const row = out.values.data() + static_cast<ptrdiff_t>(y) * out.size.width;
    kernels().mean_cells(view.row(channel, y * unit), view.width, unit, out.size.width, row);
  }
}

void BrightnessPyramid::read(const PlanarView& view, Size picture) {
  constexpr int green = 1;
  unit_ = std::max(1, (picture.width + columns / 2) / columns);
  maps_[0].resize({picture.width / unit_, picture.height / unit_});
  read_means(view, green, unit_, maps_[0]);
  levels_ = 1;
  while (levels_ < most_levels && std::min(maps_[levels_ - 1].size.width, maps_[levels_ - 1].size.height) >= 4 * ImageMotion::patch) {
    halve(maps_[levels_ - 1], maps_[levels_]);
    ++levels_;
  }
}

void ImageMotion::find(const BrightnessPyramid& now, const BrightnessPyramid& before, int finest) {
  for (int level = now.levels() - 1; level >= finest; --level) {
    const FloatView seen = now.level(level).view();
    start({(seen.width - patch) / step + 1, (seen.height - patch) / step + 1}, level == now.levels() - 1);
    refine(seen, before.level(level).view());
    smooth();
  }
}

// Start values: no shift on the coarsest level, else twice the shift of the nearest patch of the coarser level.
void ImageMotion::start(Size patches, bool coarsest) {
  const Size coarse = patches_;
  std::swap(x_, former_x_);
  std::swap(y_, former_y_);
  patches_ = patches;
  x_.assign(count_of(patches), 0.0f);
  y_.assign(count_of(patches), 0.0f);
  if (coarsest) return;
  const auto nearest = [](int i, int count) {
    const float middle = static_cast<float>(i * step + patch / 2) / 2.0f;
    return std::clamp(static_cast<int>((middle - patch / 2.0f) / step + 0.5f), 0, count - 1);
  };
  for (int y = 0; y < patches.height; ++y) {
    for (int x = 0; x < patches.width; ++x) {
      const auto to = static_cast<size_t>(y * patches.width + x);
      const auto from = static_cast<size_t>(nearest(y, coarse.height) * coarse.width + nearest(x, coarse.width));
      x_[to] = 2.0f * former_x_[from];
      y_[to] = 2.0f * former_y_[from];
    }
  }
}

void ImageMotion::refine(const FloatView& now, const FloatView& before) {
  const auto follow_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < patches_.width; ++x) {
        const auto i = static_cast<size_t>(y * patches_.width + x);
        follow(now, before, x * step, y * step, x_[i], y_[i]);
      }
    }
  };
  parallel_for(patches_.height, 1, follow_rows);
}

// Replaces single outliers by what their neighbours found.
void ImageMotion::smooth() {
  former_x_ = x_;
  former_y_ = y_;
  for (int y = 0; y < patches_.height; ++y) {
    for (int x = 0; x < patches_.width; ++x) {
      const auto i = static_cast<size_t>(y * patches_.width + x);
      x_[i] = median_around(former_x_, patches_, x, y);
      y_[i] = median_around(former_y_, patches_, x, y);
    }
  }
}

ImageMotion::Shift ImageMotion::middle() {
  const auto of = [this](const std::vector<float>& values) {
    former_x_ = values;
    return median(former_x_);
  };
  return {of(x_), of(y_)};
}

float ImageMotion::outwards() {
  for (int y = 0; y < patches_.height; ++y) {
    for (int x = 0; x < patches_.width; ++x) {
      const auto i = static_cast<size_t>(y * patches_.width + x);
      const float right = static_cast<float>(2 * x + 1 - patches_.width);
      const float down = static_cast<float>(2 * y + 1 - patches_.height);
      former_x_[i] = (x_[i] * right + y_[i] * down) / std::max(1.0f, std::hypot(right, down));
    }
  }
  return median(former_x_);
}

ImageMotion::Shift ImageMotion::at(float x, float y) const {
  constexpr float middle = (patch - 1) / 2.0f;
  const Between column((x - middle) / step, patches_.width);
  const Between row((y - middle) / step, patches_.height);
  return {blend({x_.data(), patches_.width, patches_.height}, column, row),
          blend({y_.data(), patches_.width, patches_.height}, column, row)};
}

ImageMotion::Shift ImageMotion::of_patch(int x, int y, int patches_x, int patches_y) const {
  constexpr float middle = (patch - 1) / 2.0f;
  const auto place = [](int pixel, int further, int count) {
    return std::clamp(static_cast<int>(std::floor((static_cast<float>(pixel) - middle) / step + 0.5f)) + further, 0, count - 1);
  };
  const auto i = static_cast<size_t>(place(y, patches_y, patches_.height) * patches_.width + place(x, patches_x, patches_.width));
  return {x_[i], y_[i]};
}

}  // namespace endosdk
