// The inner loop of the matching cost: one row of a window.
#pragma once

#include "matching_cost.hpp"

namespace patchmatch {

// `count` pixels of row `y` from column `left` on, and their weights. On this row the plane says a x + start.
struct WindowRow {
  int y, left, count;
  const float* weights;
  float a, start;
};

// Weighted cost of the row; `direction` is 1 for the left view, -1 for the right one.
[[nodiscard]] float row_cost(const View& view, const View& other, const WindowRow& row, float direction,
                             float farthest);

}  // namespace patchmatch
