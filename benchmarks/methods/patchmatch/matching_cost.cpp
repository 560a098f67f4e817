#include "matching_cost.hpp"

#include <algorithm>
#include <cmath>

#include "row_cost.hpp"

namespace patchmatch {

View::View(const std::uint8_t* rgb, int rows, int columns) : height(rows), width(columns) {
  const auto size = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  std::vector<float> gray(size);
  for (auto& plane : planes) plane.assign(size + kReadBeyond, 0.0F);
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
    : left(0), right(0), top(0), bottom(0), middle(0), side(2 * radius + 1), radius_(radius) {
  weights.resize(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
}

void Window::centre(const View& view, int x, int y) {
  left = std::max(0, x - radius_);
  right = std::min(view.width - 1, x + radius_);
  top = std::max(0, y - radius_);
  bottom = std::min(view.height - 1, y + radius_);
  middle = y;
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
  const float farthest = static_cast<float>(max_disparity);
  float total = 0.0F;
  auto add = [&](int y) {
    const float* row = weights.data() + static_cast<std::ptrdiff_t>(y - top) * side;
    const float start = plane.b * static_cast<float>(y) + plane.c;
    total += row_cost(view, other, {y, left, right - left + 1, row, plane.a, start}, static_cast<float>(sign), farthest);
  };
  // From the middle outwards: weights are largest there, so a bad plane passes the limit after a few rows.
  add(middle);
  for (int away = 1; away <= radius_ && total <= limit; ++away) {
    if (middle - away >= top) add(middle - away);
    if (middle + away <= bottom) add(middle + away);
  }
  return total;
}

}  // namespace patchmatch
