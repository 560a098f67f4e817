// What kernels compute for the functions of model files (functions/function.hpp), one row or less at a time.
#pragma once

#include <cstddef>
#include <cstdint>

namespace endosdk {

// Pixels along a side of the cells on whose grid networks compare two views.
constexpr int comparison_cell = 4;

// One row of a view at three quarters of its width and height, colours side by side, and what it adds to brightness.
struct SmallerRow {
  const uint8_t* upper[3];  // of the two rows of the view around it
  const uint8_t* lower[3];
  float lower_share;
  int groups;     // of four pixels of the view, which become three
  float* pixels;  // 9 * groups values
  float share;    // of a value in brightness
  bool first;     // of the rows whose brightness is one
  float* bright;  // 3 * groups values
};

// What is averaged where two views are compared: the slope along the row, the difference of the views, their product, and
// the squares of both.
constexpr int view_moments = 5;

// One row of brightness of both views, compared at the disparity of the cells around it.
struct CompareRow {
  const float* left;
  const float* right;
  int width;           // a multiple of comparison_cell
  const float* upper;  // disparity of the rows of cells around, px
  const float* lower;
  float lower_share;
  int columns;  // averaged into one: 2 or 4
  float share;  // of each value in its mean
  bool first;   // of the rows averaged into one; others add to what there is
  float* scratch;
  float* means[view_moments];  // width / columns values each

  static int scratch_values(int width) { return 3 * width + width / comparison_cell + 2; }
};

// The side of the largest window, cells.
constexpr int solve_window = 7;

// What windows of means say: the step of Lucas and Kanade, and how unlike the values within them are.
struct SolveRow {
  const float* rows[solve_window];  // the first plane of each row of the window that lies inside the picture
  ptrdiff_t plane_stride;
  int count;  // of rows
  int cells;
  int reach;           // cells of the window to each side
  const float* share;  // of a cell in the mean over its window, for each window
  float damping;
  float quiet;
  float log_share;
  float largest_step;  // px
  float* scratch;
  float* step;
  float* texture;   // logarithms of variances, times log_share
  float* mismatch;

  static int scratch_values(int cells, int reach) { return view_moments * (2 * cells + 2 * reach); }
};

// Cells to each side of a square.
constexpr int extreme_reach = 2;

// The largest and the smallest value of the square around each cell of a row.
struct ExtremesRow {
  const float* rows[2 * extreme_reach + 1];  // of the square that lie inside the map
  int count;
  int cells;
  float* scratch;
  float* most;
  float* least;

  static int scratch_values(int cells) { return 2 * (cells + 2 * extreme_reach); }
};

// Cells whose planes are searched together.
constexpr int soft_argmin_width = 32;

// The mean of the planes around the likeliest one, weighted by exp(-cost), and the variance of all of them beyond what
// lies between two planes.
struct SoftArgminCells {
  const float* cost;   // planes rows of soft_argmin_width values
  const float* index;  // of each plane among all, from far to near
  const float* value;  // its disparity, cells
  int planes;
  float reach;  // planes
  float dense;  // cells; from there on planes are `gap` apart
  float gap;
  float* mean;  // cells
  float* excess;
};

// One row of an answer on a grid of twice the size, of what a refinement gave for a row of cells: of each two pixels of a
// cell the left one, then the right one.
struct ChooseRow {
  const float* disparity;  // of the cells, px
  const float* beside;     // of the cells above or below, whichever the row is nearer to
  const float* correction[2];
  const float* belief[2];  // logits
  const float* to_near[2];
  const float* to_far[2];
  const float* step[2];
  const float* near;
  const float* far;
  int cells;
  float* mixed;   // cells values of scratch memory, with one more at both ends
  float* answer;  // 2 * cells values each
  float* change;
  float* rough;
};

}  // namespace endosdk
