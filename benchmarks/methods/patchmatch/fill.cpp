#include "fill.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace patchmatch {

namespace {

// The compiler may assume that no number is NaN (-ffast-math), so NaN is told by its bits.
bool missing(float value) { return (std::bit_cast<std::uint32_t>(value) & 0x7fffffffU) > 0x7f800000U; }

float at(const Plane& plane, int x, int y, int max_disparity) {
  return std::clamp(plane.at(x, y), 0.0F, static_cast<float>(max_disparity));
}

}  // namespace

void check(const std::vector<Plane>& left, const std::vector<Plane>& right, int height, int width, float* disparity) {
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto here = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const float found = left[here].at(x, y);
      const int match = x - static_cast<int>(std::lround(found));
      disparity[here] = std::numeric_limits<float>::quiet_NaN();
      if (match < 0 || match >= width) continue;
      const std::size_t there = here - static_cast<std::size_t>(x) + static_cast<std::size_t>(match);
      if (std::abs(right[there].at(match, y) - found) <= 1.0F) disparity[here] = found;
    }
  }
}

void fill(const std::vector<Plane>& planes, int height, int width, int max_disparity, const float* checked,
          float* filled) {
  std::vector<int> after(static_cast<std::size_t>(width));
  for (int y = 0; y < height; ++y) {
    const auto row = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    int next = -1, before = -1;
    for (int x = width - 1; x >= 0; --x) {
      if (!missing(checked[row + static_cast<std::size_t>(x)])) next = x;
      after[static_cast<std::size_t>(x)] = next;
    }
    for (int x = 0; x < width; ++x) {
      const auto column = static_cast<std::size_t>(x);
      if (!missing(checked[row + column])) {
        before = x;
        filled[row + column] = checked[row + column];
        continue;
      }
      float found = std::numeric_limits<float>::max();
      for (const int side : {before, after[column]}) {
        if (side >= 0) found = std::min(found, at(planes[row + static_cast<std::size_t>(side)], x, y, max_disparity));
      }
      // A row without any valid pixel keeps what its own planes say.
      filled[row + column] = before < 0 && after[column] < 0 ? at(planes[row + column], x, y, max_disparity) : found;
    }
  }
}

void smooth(const View& view, int radius, const float* checked, const std::vector<float>& filled, int first_row,
            int last_row, float* out) {
  Window window(radius);
  std::vector<std::pair<float, float>> entries;
  for (int y = first_row; y < last_row; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const std::ptrdiff_t here = static_cast<std::ptrdiff_t>(y) * view.width + x;
      out[here] = filled[static_cast<std::size_t>(here)];
      if (!missing(checked[here])) continue;
      window.centre(view, x, y);
      entries.clear();
      float total = 0.0F;
      for (int v = window.top; v <= window.bottom; ++v) {
        for (int u = window.left; u <= window.right; ++u) {
          const float weight = window.weights[static_cast<std::size_t>((v - window.top) * window.side + u - window.left)];
          entries.emplace_back(filled[static_cast<std::size_t>(v) * static_cast<std::size_t>(view.width) +
                                      static_cast<std::size_t>(u)],
                               weight);
          total += weight;
        }
      }
      std::sort(entries.begin(), entries.end());
      float sum = 0.0F;
      for (const auto& [value, weight] : entries) {
        sum += weight;
        if (sum >= 0.5F * total) {
          out[here] = value;
          break;
        }
      }
    }
  }
}

}  // namespace patchmatch
