#include "matching_cost.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace patchmatch {

namespace {

using Channels = float __attribute__((vector_size(16)));

Channels load(const float* from) {
  Channels values;
  std::memcpy(&values, from, sizeof values);
  return values;
}

}  // namespace

View::View(const std::uint8_t* rgb, int rows, int columns) : height(rows), width(columns) {
  const auto size = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  std::vector<float> gray(size);
  for (auto& plane : planes) plane.assign(size, 0.0F);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t c = 0; c < 3; ++c) planes[c][i] = rgb[3 * i + c];
    gray[i] = 0.299F * planes[0][i] + 0.587F * planes[1][i] + 0.114F * planes[2][i];
  }
  for (int y = 0; y < rows; ++y) {
    const float* source = gray.data() + static_cast<std::ptrdiff_t>(y) * columns;
    float* target = planes[3].data() + static_cast<std::ptrdiff_t>(y) * columns;
    for (int x = 0; x < columns; ++x) {
      target[x] = 0.5F * (source[std::min(x + 1, columns - 1)] - source[std::max(x - 1, 0)]);
    }
  }
  packed.resize(4 * size);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t c = 0; c < 4; ++c) packed[4 * i + c] = planes[c][i];
  }
}

Window::Window(int radius)
    : left(0), right(0), top(0), bottom(0), side(2 * radius + 1), radius_(radius) {
  weights.resize(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
}

void Window::centre(const View& view, int x, int y) {
  left = std::max(0, x - radius_);
  right = std::min(view.width - 1, x + radius_);
  top = std::max(0, y - radius_);
  bottom = std::min(view.height - 1, y + radius_);
  const float r = view.row(0, y)[x], g = view.row(1, y)[x], b = view.row(2, y)[x];
  for (int v = top; v <= bottom; ++v) {
    const float *reds = view.row(0, v) + left, *greens = view.row(1, v) + left, *blues = view.row(2, v) + left;
    float* out = weights.data() + static_cast<std::ptrdiff_t>(v - top) * side;
    const int count = right - left + 1;
    for (int i = 0; i < count; ++i) {
      out[i] = std::exp(-(std::abs(reds[i] - r) + std::abs(greens[i] - g) + std::abs(blues[i] - b)) / kColourScale);
    }
  }
}

float Window::cost(const View& view, const View& other, const Plane& plane, int sign, int max_disparity,
                   float limit) const {
  const int count = right - left + 1;
  const float farthest = static_cast<float>(max_disparity), last = static_cast<float>(view.width - 1);
  const float direction = static_cast<float>(sign);
  const int before_last = view.width - 2;
  int at[kLargestSide];
  float share[kLargestSide], possible[kLargestSide], differences[4 * kLargestSide];
  float total = 0.0F;
  for (int y = top; y <= bottom && total <= limit; ++y) {
    const float* weight = weights.data() + static_cast<std::ptrdiff_t>(y - top) * side;
    const float* own = view.pixels(y) + 4 * left;
    const float* match = other.pixels(y);
    const float start = plane.b * static_cast<float>(y) + plane.c;
    // Three passes over the row: where each pixel's match lies, how far its four channels are off, what that costs. The
    // first and the last run over many pixels at once, the middle one over the channels of one: gathers are slow.
    for (int i = 0; i < count; ++i) {
      const float x = static_cast<float>(left + i);
      const float disparity = plane.a * x + start;
      const float place = x - direction * disparity;
      const float inside = std::min(std::max(place, 0.0F), last);
      at[i] = std::min(static_cast<int>(inside), before_last);
      share[i] = inside - static_cast<float>(at[i]);
      possible[i] = static_cast<float>((disparity >= 0.0F) & (disparity <= farthest) & (place == inside)) * weight[i];
    }
    for (int i = 0; i < count; ++i) {
      const Channels first = load(match + 4 * at[i]), second = load(match + 4 * at[i] + 4);
      const Channels off = load(own + 4 * i) - (first + share[i] * (second - first));
      std::memcpy(differences + 4 * i, &off, sizeof off);
    }
    float sum = 0.0F;
    for (int i = 0; i < count; ++i) {
      const float* off = differences + 4 * i;
      const float colour = std::abs(off[0]) + std::abs(off[1]) + std::abs(off[2]);
      const float cost = (1.0F - kGradientShare) * std::min(colour, kColourLimit) +
                         kGradientShare * std::min(std::abs(off[3]), kGradientLimit);
      sum += weight[i] * kWorstCost + possible[i] * (cost - kWorstCost);
    }
    total += sum;
  }
  return total;
}

}  // namespace patchmatch
