// Rows of what networks read of the views, and of the comparison of the views. The file is compiled once per instruction set.
#include "kernels/kernels.hpp"
#include "kernels/maths.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

constexpr int grid = comparison_cell;
constexpr int moment_planes = view_moments;
constexpr int smaller_width = 64;  // groups of pixels at a time, in smaller_row

// Interpolates the values of cells to pixels. cells[-1] and cells[count] repeat the border.
void stretch_cells(const float* cells, int count, float* __restrict pixels) {
  for (int i = 0; i < count; ++i) {
    const float before = cells[i - 1];
    const float here = cells[i];
    const float after = cells[i + 1];
    pixels[grid * i] = 0.375f * before + 0.625f * here;
    pixels[grid * i + 1] = 0.125f * before + 0.875f * here;
    pixels[grid * i + 2] = 0.875f * here + 0.125f * after;
    pixels[grid * i + 3] = 0.625f * here + 0.375f * after;
  }
}

// Computes the values that are averaged. They are summed over groups of `columns` pixels and multiplied by `share`. The first
// row writes the means, the other rows add to them. The outputs do not overlap, see `solve_cells`.
template <int columns, bool first>
void add_moments(const float* left, const float* moved, const float* slope, int count, float share,
                 float* __restrict slopes, float* __restrict differences, float* __restrict products,
                 float* __restrict slope_squares, float* __restrict difference_squares) {
  const auto sum_of = [](const auto& value) {
    const float sum = value(0) + value(1);
    return columns == 2 ? sum : sum + (value(2) + value(3));
  };
  const auto added = [&](float sum, float before) { return first ? sum * share : before + sum * share; };
  for (int i = 0; i < count; ++i) {
    const float* const l = left + columns * i;
    const float* const m = moved + columns * i;
    const float* const s = slope + columns * i;
    const auto difference = [&](int k) { return l[k] - m[k]; };
    slopes[i] = added(sum_of([&](int k) { return s[k]; }), slopes[i]);
    differences[i] = added(sum_of(difference), differences[i]);
    products[i] = added(sum_of([&](int k) { return s[k] * difference(k); }), products[i]);
    slope_squares[i] = added(sum_of([&](int k) { return s[k] * s[k]; }), slope_squares[i]);
    difference_squares[i] = added(sum_of([&](int k) { return difference(k) * difference(k); }), difference_squares[i]);
  }
}

// Slope along the row, of the sum of both views. A pixel at the border has only one neighbour. Rows are at least one cell wide.
void find_slope(const float* left, const float* moved, int width, float* __restrict slope) {
  const auto between = [&](int before, int after) {
    return ((left[after] + moved[after]) - (left[before] + moved[before])) * 0.25f;
  };
  slope[0] = between(0, 1);
  for (int x = 1; x + 1 < width; ++x) slope[x] = between(x - 1, x + 1);
  slope[width - 1] = between(width - 2, width - 1);
}

// Reads a row of the right view at positions moved by the disparity.
void move_right(const CompareRow& row, const float* shift, float* __restrict moved) {
  const float last = static_cast<float>(row.width - 1);
  const float last_pair = static_cast<float>(row.width - 2);
  const float* const right = row.right;
  for (int x = 0; x < row.width; ++x) {
    const float place = at_most(at_least(static_cast<float>(x) - shift[x], 0.0f), last);
    const auto base = static_cast<int32_t>(at_most(place, last_pair));  // places are not negative, so this is the floor
    const float near = right[base];
    moved[x] = near + (place - static_cast<float>(base)) * (right[base + 1] - near);
  }
}

// Adds up rows of values. The first three are added in one loop, because most windows have three.
void add_up(const float* const* rows, int count, int length, float* __restrict out) {
  const float* const first = rows[0];
  if (count < 3) {
    for (int x = 0; x < length; ++x) out[x] = first[x];
    if (count == 2) {
      for (int x = 0; x < length; ++x) out[x] += rows[1][x];
    }
    return;
  }
  const float* const second = rows[1];
  const float* const third = rows[2];
  for (int x = 0; x < length; ++x) out[x] = first[x] + second[x] + third[x];
  for (int y = 3; y < count; ++y) {
    const float* const row = rows[y];
    for (int x = 0; x < length; ++x) out[x] += row[x];
  }
}

// Computes the step of each window. `means` holds the planes of means one after the other. The outputs are __restrict: for so
// many arrays, the compiler cannot test whether they overlap, and would take one cell at a time.
void solve_cells(const SolveRow& row, const float* means, float* __restrict step, float* __restrict textures,
                 float* __restrict mismatches) {
  const float* const slope = means;
  const float* const difference = means + row.cells;
  const float* const product = means + 2 * row.cells;
  const float* const slope_square = means + 3 * row.cells;
  const float* const difference_square = means + 4 * row.cells;
  for (int x = 0; x < row.cells; ++x) {
    const float texture = at_least(slope_square[x] - slope[x] * slope[x], 0.0f);
    const float mismatch = at_least(difference_square[x] - difference[x] * difference[x], 0.0f);
    const float solved = (slope[x] * difference[x] - product[x]) / (texture + row.damping);
    step[x] = at_most(at_least(solved, -row.largest_step), row.largest_step);
    textures[x] = log_of(texture + row.quiet) * row.log_share;
    mismatches[x] = log_of(mismatch + row.quiet) * row.log_share;
  }
}

// The largest of the largest, and the smallest of the smallest values around each cell of a row.
template <int reach>
void extremes_along(const float* most, const float* least, int cells, float* __restrict largest, float* __restrict smallest) {
  for (int x = 0; x < cells; ++x) {
    float high = most[x - reach];
    float low = least[x - reach];
    for (int i = 1 - reach; i <= reach; ++i) {
      high = at_least(most[x + i], high);
      low = at_most(least[x + i], low);
    }
    largest[x] = high;
    smallest[x] = low;
  }
}

// Groups of three pixels: [colour][place in the group][group].
using Smaller = float[3][3][smaller_width];

// Computes one colour of groups of three pixels. Each group comes from four pixels of two rows.
void mix_groups(const uint8_t* upper, const uint8_t* lower, float lower_share, int count, float (&out)[3][smaller_width]) {
  constexpr float small = 1.0f / 6.0f;  // three pixels lie 1/6, 3/2 and 17/6 pixels after the first of four
  constexpr float large = 5.0f / 6.0f;
  const float upper_share = 1.0f - lower_share;
  for (int i = 0; i < count; ++i) {
    const auto mixed = [&](int x) {
      return upper_share * static_cast<float>(upper[4 * i + x]) + lower_share * static_cast<float>(lower[4 * i + x]);
    };
    out[0][i] = large * mixed(0) + small * mixed(1);
    out[1][i] = 0.5f * mixed(1) + 0.5f * mixed(2);
    out[2][i] = small * mixed(2) + large * mixed(3);
  }
}

}  // namespace

void interleave_row(const uint8_t* c0, const uint8_t* c1, const uint8_t* c2, int count, uint8_t* __restrict out) {
  for (int i = 0; i < count; ++i) {
    out[3 * i] = c0[i];
    out[3 * i + 1] = c1[i];
    out[3 * i + 2] = c2[i];
  }
}

void pair_brightness(const uint8_t* const* channel, ptrdiff_t stride, int count, float share, float* __restrict out) {
  const uint8_t* const c0 = channel[0];
  const uint8_t* const c1 = channel[1];
  const uint8_t* const c2 = channel[2];
  for (int i = 0; i < count; ++i) {
    const int sum = c0[i] + c0[i + stride] + c1[i] + c1[i + stride] + c2[i] + c2[i + stride];
    out[i] = static_cast<float>(sum) * share;
  }
}

void smaller_row(const SmallerRow& row) {
  Smaller smaller;
  for (int first = 0; first < row.groups; first += smaller_width) {
    const int count = row.groups - first < smaller_width ? row.groups - first : smaller_width;
    for (int c = 0; c < 3; ++c) mix_groups(row.upper[c] + 4 * first, row.lower[c] + 4 * first, row.lower_share, count, smaller[c]);
    float* const pixels = row.pixels + 9 * first;
    for (int i = 0; i < count; ++i) {
      for (int x = 0; x < 3; ++x) {
        for (int c = 0; c < 3; ++c) pixels[9 * i + 3 * x + c] = smaller[c][x][i];
      }
    }
    float* const bright = row.bright + 3 * first;
    for (int x = 0; x < 3; ++x) {
      for (int i = 0; i < count; ++i) {
        const float added = (smaller[0][x][i] + smaller[1][x][i] + smaller[2][x][i]) * row.share;
        bright[3 * i + x] = row.first ? added : bright[3 * i + x] + added;
      }
    }
  }
}

void compare_row(const CompareRow& row) {
  const int cells = row.width / grid;
  float* const mixed = row.scratch + 1;  // one more cell at both ends
  float* const shift = mixed + cells + 1;
  float* const moved = shift + row.width;
  float* const slope = moved + row.width;
  for (int i = 0; i < cells; ++i) {
    mixed[i] = (1.0f - row.lower_share) * row.upper[i] + row.lower_share * row.lower[i];
  }
  mixed[-1] = mixed[0];
  mixed[cells] = mixed[cells - 1];
  stretch_cells(mixed, cells, shift);
  move_right(row, shift, moved);
  find_slope(row.left, moved, row.width, slope);
  const auto add = row.columns == 2 ? (row.first ? add_moments<2, true> : add_moments<2, false>)
                                    : (row.first ? add_moments<4, true> : add_moments<4, false>);
  add(row.left, moved, slope, row.width / row.columns, row.share, row.means[0], row.means[1], row.means[2], row.means[3],
      row.means[4]);
}

void solve_row(const SolveRow& row) {
  const int stride = row.cells + 2 * row.reach;
  float* const means = row.scratch + moment_planes * stride;
  for (int plane = 0; plane < moment_planes; ++plane) {
    float* const sums = row.scratch + plane * stride;
    for (int i = 0; i < row.reach; ++i) sums[i] = sums[row.reach + row.cells + i] = 0.0f;
    const float* rows[solve_window];
    for (int y = 0; y < row.count; ++y) rows[y] = row.rows[y] + plane * row.plane_stride;
    add_up(rows, row.count, row.cells, sums + row.reach);
    const float* shifted[solve_window];
    const int window = 2 * row.reach + 1;
    for (int i = 0; i < window; ++i) shifted[i] = sums + i;
    float* const mean = means + plane * row.cells;
    add_up(shifted, window, row.cells, mean);
    for (int x = 0; x < row.cells; ++x) mean[x] *= row.share[x];
  }
  solve_cells(row, means, row.step, row.texture, row.mismatch);
}

void extremes_row(const ExtremesRow& row) {
  float* const most = row.scratch + row.reach;
  float* const least = most + row.cells + 2 * row.reach;
  for (int x = 0; x < row.cells; ++x) most[x] = least[x] = row.rows[0][x];
  for (int y = 1; y < row.count; ++y) {
    const float* const values = row.rows[y];
    for (int x = 0; x < row.cells; ++x) most[x] = at_least(values[x], most[x]);
    for (int x = 0; x < row.cells; ++x) least[x] = at_most(values[x], least[x]);
  }
  for (int i = 1; i <= row.reach; ++i) {
    most[-i] = most[0];
    least[-i] = least[0];
    most[row.cells + i - 1] = most[row.cells - 1];
    least[row.cells + i - 1] = least[row.cells - 1];
  }
  const auto along = row.reach == 1 ? extremes_along<1> : row.reach == 2 ? extremes_along<2> : extremes_along<longest_reach>;
  along(most, least, row.cells, row.most, row.least);
}

}  // namespace endosdk::ENDOSDK_ISA
