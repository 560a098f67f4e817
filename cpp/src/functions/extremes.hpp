// The largest and the smallest value around each cell of one row of a map.
#pragma once

#include <algorithm>
#include <cstddef>

#include "kernels/kernels.hpp"

namespace endosdk {

// The squares reach `reach` cells to each side (`ExtremesRow`) and end where the map ends.
inline void find_extremes(const float* map, int rows, int cells, int y, int reach, float* scratch, float* most, float* least) {
  ExtremesRow row;
  row.count = 0;
  for (int j = std::max(y - reach, 0); j <= std::min(y + reach, rows - 1); ++j) {
    row.rows[row.count++] = map + static_cast<ptrdiff_t>(j) * cells;
  }
  row.cells = cells;
  row.reach = reach;
  row.scratch = scratch;
  row.most = most;
  row.least = least;
  kernels().extremes_row(row);
}

}  // namespace endosdk
