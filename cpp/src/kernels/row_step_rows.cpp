// Sums for a Lucas-Kanade step between two views at the matches found, compiled once per instruction set: a plain loop that
// the compiler vectorises.
#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

// Grey levels between which brightness follows the surface: below is no light, above is glare.
constexpr float darkest = 6.0f;
constexpr float brightest = 245.0f;

}  // namespace

void row_step_row(const RowStepRow& row) {
  const ptrdiff_t columns = row.columns;
  const float* const here = row.left + row.row * columns;
  const float* const above = here - columns;
  const float* const below = here + columns;
  const float end = static_cast<float>(row.columns - 1);
  const float bottom = static_cast<float>(row.rows - 1);
  const float place = static_cast<float>(row.row);
  float* const sums = row.sums;
  const ptrdiff_t plane = row.cells;
  for (int i = 1; i < row.cells; ++i) {  // the first cell has no column to its left
    const float at = static_cast<float>(2 * i) - row.disparity[i];
    const float lower = place + row.offset[i];
    const int inside = (at >= 0.0f) & (at <= end) & (lower >= 0.0f) & (lower <= bottom);  // what is no number is not
    const float x = inside ? at : 0.0f;
    const float y = inside ? lower : 0.0f;
    int column = static_cast<int>(x);
    int line = static_cast<int>(y);
    column = column < row.columns - 2 ? column : row.columns - 2;
    line = line < row.rows - 2 ? line : row.rows - 2;
    const float along = x - static_cast<float>(column);
    const float down = y - static_cast<float>(line);
    const int from = line * row.columns + column;
    const float* const right = row.right;
    const float upper = right[from] + along * (right[from + 1] - right[from]);
    const float under = right[from + row.columns] + along * (right[from + row.columns + 1] - right[from + row.columns]);
    const float there = upper + down * (under - upper);
    const float level = here[2 * i];
    const int lit = (level > darkest) & (level < brightest) & (there > darkest) & (there < brightest);
    const float counts = (inside & lit) != 0 ? row.wanted[i] : 0.0f;
    const float gx = counts * 0.5f * (here[2 * i + 1] - here[2 * i - 1]);
    const float gy = counts * 0.5f * (below[2 * i] - above[2 * i]);
    const float rest = counts * (level - there);
    sums[i] += counts;
    sums[plane + i] += gx;
    sums[2 * plane + i] += gy;
    sums[3 * plane + i] += rest;
    sums[4 * plane + i] += gx * gx;
    sums[5 * plane + i] += gx * gy;
    sums[6 * plane + i] += gy * gy;
    sums[7 * plane + i] += gx * rest;
    sums[8 * plane + i] += gy * rest;
  }
}

}  // namespace endosdk::ENDOSDK_ISA
