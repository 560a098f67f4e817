// Sums for a Lucas-Kanade step between two views at the matches found. The file is compiled once per instruction set: plain
// loops that the compiler vectorises.
#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

// Brightness follows the surface only between these grey levels: below there is no light, above there is glare.
constexpr float darkest = 6.0f;
constexpr float brightest = 245.0f;

// Number of cells at a time.
constexpr int chunk = 128;

void add_products(const float* a, const float* b, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] += a[i] * b[i];
}

void add(const float* values, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] += values[i];
}

// Computes one step for each window. The values are taken relative to their mean over the window.
void solve(const float (&s)[row_step_sums][chunk], const RowWindows& windows, int count, float* __restrict step, float* __restrict weight) {
  constexpr float cells = row_window_cells;
  constexpr float share = 1.0f / cells;
  const float least = windows.least_information;
  const float enough = windows.enough_information;
  const float longest = windows.longest_step;
  const float ridge = windows.ridge;
  for (int i = 0; i < count; ++i) {
    const float xx = s[4][i] - s[1][i] * s[1][i] * share + ridge;
    const float xy = s[5][i] - s[1][i] * s[2][i] * share;
    const float yy = s[6][i] - s[2][i] * s[2][i] * share;
    const float along = s[7][i] - s[1][i] * s[3][i] * share;
    const float across = s[8][i] - s[2][i] * s[3][i] * share;
    const float determinant = xx * yy - xy * xy;
    const float divisor = determinant > 0.0f ? determinant : 1.0f;  // without gradients; it has no information then
    const float found = (xx * across - xy * along) / divisor;
    const float information = determinant / xx;
    const int usable = (s[0][i] == cells) & (information > least) & (found > -longest) & (found < longest);
    step[i] = usable ? found : 0.0f;
    weight[i] = usable ? information / (information + enough) : 0.0f;
  }
}

}  // namespace

void row_step_row(const RowStepRow& row) {
  const ptrdiff_t columns = row.columns;
  const float end = static_cast<float>(row.columns - 1);
  const float bottom = static_cast<float>(row.rows - 1);
  const float place = static_cast<float>(row.row);
  const float gain = row.gain;
  for (int first = 1; first < row.cells; first += chunk) {  // the first cell has no column to its left
    const int count = row.cells - first < chunk ? row.cells - first : chunk;
    const float* const here = row.left + row.row * columns + 2 * first;
    const float* const above = here - columns;
    const float* const below = here + columns;
    const float* const disparity = row.disparity + first;
    const float* const offset = row.offset + first;
    const float* const wanted = row.wanted + first;
    const float* const right = row.right;
    float counts[chunk], gx[chunk], gy[chunk], rest[chunk];
    for (int i = 0; i < count; ++i) {
      const float at = static_cast<float>(2 * (first + i)) - disparity[i];
      const float lower = place + offset[i];
      const int inside = (at >= 0.0f) & (at <= end) & (lower >= 0.0f) & (lower <= bottom);  // false for NaN
      const float x = inside ? at : 0.0f;
      const float y = inside ? lower : 0.0f;
      int column = static_cast<int>(x);
      int line = static_cast<int>(y);
      column = column < row.columns - 2 ? column : row.columns - 2;
      line = line < row.rows - 2 ? line : row.rows - 2;
      const float along = x - static_cast<float>(column);
      const float down = y - static_cast<float>(line);
      const int from = line * row.columns + column;
      const float upper = right[from] + along * (right[from + 1] - right[from]);
      const float under = right[from + row.columns] + along * (right[from + row.columns + 1] - right[from + row.columns]);
      const float there = upper + down * (under - upper);
      const float level = here[2 * i];
      const int lit = (level > darkest) & (level < brightest) & (there > darkest) & (there < brightest);
      counts[i] = (inside & lit) != 0 ? wanted[i] : 0.0f;
      gx[i] = counts[i] * 0.5f * (here[2 * i + 1] - here[2 * i - 1]);
      gy[i] = counts[i] * 0.5f * (below[2 * i] - above[2 * i]);
      rest[i] = counts[i] * (level - gain * there);
    }
    float* const sums = row.sums + first;
    const float* const plain[] = {counts, gx, gy, rest};
    for (int p = 0; p < 4; ++p) add(plain[p], count, sums + p * static_cast<ptrdiff_t>(row.cells));
    const float* const factors[][2] = {{gx, gx}, {gx, gy}, {gy, gy}, {gx, rest}, {gy, rest}};
    for (int p = 0; p < 5; ++p) add_products(factors[p][0], factors[p][1], count, sums + (4 + p) * static_cast<ptrdiff_t>(row.cells));
  }
}

void row_windows(const RowWindows& row) {
  for (int first = 0; first < row.count; first += chunk) {
    const int count = row.count - first < chunk ? row.count - first : chunk;
    float sums[row_step_sums][chunk];
    for (int p = 0; p < row_step_sums; ++p) {
      const float* const plane = row.sums + p * static_cast<ptrdiff_t>(row.cells) + 2 * first;
      for (int i = 0; i < count; ++i) sums[p][i] = plane[2 * i] + plane[2 * i + 1] + plane[2 * i + 2];
    }
    solve(sums, row, count, row.step + first, row.weight + first);
  }
}

}  // namespace endosdk::ENDOSDK_ISA
