// Work for the kernels behind the functions of model files (functions/function.hpp), one row or less at a time.
#pragma once

#include <cstddef>
#include <cstdint>

namespace endosdk {

// Pixels along a side of a cell. Networks compare two views on the grid of these cells.
constexpr int comparison_cell = 4;

// One row of a view reduced to three quarters of its width and height, with the colours side by side. It also adds its part to
// a row of brightness.
struct SmallerRow {
  const uint8_t* upper[3];  // the row of the view above it, per channel
  const uint8_t* lower[3];  // the row of the view below it
  float lower_share;
  int groups;     // groups of four pixels of the view; each becomes three pixels
  float* pixels;  // 9 * groups values
  float share;    // weight of a value in the brightness
  bool first;     // the first row of a row of brightness; the other rows add to it
  float* bright;  // 3 * groups values
};

// Number of values that are averaged when two views are compared: the slope along the row, the difference of the views, the
// product of these two, and their squares.
constexpr int view_moments = 5;

// One row of brightness of both views. They are compared at a disparity that is interpolated between the cells around.
struct CompareRow {
  const float* left;
  const float* right;
  int width;           // a multiple of comparison_cell
  const float* upper;  // disparity of the row of cells above, px
  const float* lower;  // and of the row below
  float lower_share;
  int columns;  // number of columns that are averaged into one: 2 or 4
  float share;  // weight of each value in its mean
  bool first;   // the first of the rows that are averaged into one; the other rows add to its means
  float* scratch;
  float* means[view_moments];  // width / columns values each

  static int scratch_values(int width) { return 3 * width + width / comparison_cell + 2; }
};

// Side of the largest window, cells.
constexpr int solve_window = 7;

// Solves windows of means. Results are the Lucas-Kanade step, and the variances of the slope and of the difference in the
// window.
struct SolveRow {
  const float* rows[solve_window];  // first plane of each row of the window that lies inside the picture
  ptrdiff_t plane_stride;
  int count;  // number of these rows
  int cells;
  int reach;           // cells of the window on each side of its centre
  const float* share;  // weight of a cell in the mean over the window, for each window
  float damping;
  float quiet;
  float log_share;
  float largest_step;  // px
  float* scratch;
  float* step;
  float* texture;   // log_share times the logarithm of the variance of the slope
  float* mismatch;  // log_share times the logarithm of the variance of the difference

  static int scratch_values(int cells, int reach) { return view_moments * (2 * cells + 2 * reach); }
};

// Cells on each side of the centre of the largest square.
constexpr int longest_reach = 6;

// Finds the largest and the smallest value in the square around each cell of a row.
struct ExtremesRow {
  const float* rows[2 * longest_reach + 1];  // rows of the square that lie inside the map
  int count;
  int cells;
  int reach;  // cells of the square on each side of its centre: 1, 2 or 6
  float* scratch;
  float* most;
  float* least;

  static int scratch_values(int cells) { return 2 * (cells + 2 * longest_reach); }
};

// Number of cells that are computed together.
constexpr int soft_argmin_width = 32;

// Soft-argmin. It gives the mean of the planes around the most likely one, weighted by exp(-cost). It also gives the variance
// of all planes, less the variance of a value between two planes.
struct SoftArgminCells {
  const float* cost;   // planes rows of soft_argmin_width values
  const float* index;  // place of each plane among all planes, from far to near
  const float* value;  // disparity of each plane, cells
  int planes;
  float reach;  // planes; farther from the most likely one they do not count in the mean
  float dense;  // cells; from this disparity on, planes are `gap` apart
  float gap;
  float* mean;  // cells
  float* excess;
};

// One row of the answer, on a grid of twice the size, from a refinement's outputs for a row of cells. In arrays of two, the
// first element is for the left pixel of each cell, the second for the right pixel.
struct ChooseRow {
  const float* disparity;  // of the cells, px
  const float* beside;     // of the cells above or below, whichever are nearer to the row
  const float* correction[2];
  const float* belief[2];  // logits
  const float* to_near[2];
  const float* to_far[2];
  const float* step[2];
  const float* near;
  const float* far;
  int cells;
  float* mixed;   // `cells` values of scratch memory, with one more at both ends
  float* answer;  // 2 * cells values each
  float* change;
  float* rough;
};

// Number of cells that are computed together.
constexpr int thin_width = 32;

// One row of a layer with few outputs: weighted sums of inputs, plus a bias, and not below a limit. A cell next to a cell is one
// more input.
struct ThinRow {
  const float* const* inputs;  // each can be read up to the next multiple of thin_width
  int count;
  int outputs;           // 4 or 8
  const float* weights;  // as many as outputs, for each input
  const float* bias;
  float least;
  int cells;
  float* out;
  ptrdiff_t out_stride;  // from output to output
};

// The sum of two rows of 8-bit integers, as 8-bit integers: first * a + second * b + constant, rounded half to even, between
// `least` and 255.
struct SumOfBytes {
  float first;
  float second;
  float constant;
  float least;
};

// One row of the confidence, on a grid of twice the size, from the logarithm of the scale of the errors.
struct ConfidenceRow {
  const float* scale;   // of the cells
  const float* beside;  // of the cells above or below, whichever are nearer to the row
  int cells;
  float* mixed;  // as in ChooseRow
  float* out;    // 2 * cells values
};

}  // namespace endosdk
