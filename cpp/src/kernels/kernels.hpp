// The inner loops, one image row or less at a time, in several instruction sets that give the same bytes.
//
// The implementations are compiled with the flags of their instruction set. So that the linker can never pick such code
// for the rest of the program, those files define no inline or template functions with external linkage and include
// nothing that does: only the headers of this folder, <cstdint>, <cstddef>, <string.h> and the intrinsics.
#pragma once

#include <cstddef>
#include <cstdint>

#include "kernels/network_rows.hpp"

namespace endosdk {

// Source positions of consecutive output pixels. All four neighbours of each must lie inside the image.
struct RemapSpan {
  const uint32_t* corner;    // upper left neighbour: x in the low half, y in the high half
  const uint16_t* fraction;  // distance from it in 1/128 px: x in the low byte, y in the high byte
  int count;
};

// A left neighbour must have this many pixels from itself to the end of its row.
constexpr int remap_reach = 6;

constexpr int stretch_reach = 16;

// One row of the full-size maps, and what is to be made of it. Null where not wanted.
struct DepthRow {
  const float* disparity;
  const float* confidence;
  const float* own_confidence;  // the network's, for sigma
  const uint8_t* brightness;  // least channel of the left view; null: not tested
  const uint8_t* inside_left;  // the field of view; null: all of it
  const uint8_t* valid_left;
  const uint8_t* valid_right;
  uint8_t* reasons;
  float* depth;
  float* sigma;
  int width;
};

struct DepthLimits {
  float min_confidence;
  float disparity_begin;  // frame px: up to there an error of the network is as large as the disparity
  float disparity_end;    // frame px: there and beyond the network finds nothing; may be infinite
  bool metric;           // the rest holds only if true
  float focal_baseline;  // px * mm
  float doffs;           // px
  float min_depth;       // mm
  float max_depth;       // mm
  float sigma_factor;    // sigma = sigma_factor * depth^2 / -log(1 - own confidence)
};

// What a rig that moved adds, in squares, to one row of sigma: depth^4 times `constant` + per_square * u^2 +
// per_fourth * (1 + u^2)^2, where u = start + step * column.
struct RigSigmaRow {
  const float* depth;
  float* sigma;
  int width;
  float start;
  float step;
  float constant;
  float per_square;
  float per_fourth;
};

// Reduction of interleaved rows by a whole factor, 2 to 16.
struct Reduction {
  int factor;
  int channels;  // 1 or 3
  int width;     // of the output, pixels

  // 16-bit values of scratch memory that a row needs.
  int scratch() const { return 2 * width * factor * channels; }
};

// Cells that a pixel's disparity comes from when it is upsampled, along each axis.
constexpr int joint_bilateral_taps = 6;

// Planes of a row of cells: red, green, blue, trust, and trust times disparity.
constexpr int joint_bilateral_planes = 5;

// One row of a map on the grid of a view, from cells of factor x factor of its pixels.
struct JointBilateralRow {
  const uint8_t* view[3];                               // red, green, blue
  const float* cells[joint_bilateral_taps][joint_bilateral_planes];       // of the rows of cells around it
  const int* start;                                     // of each phase of a pixel within its cell: the first cell's offset
  const float* share;                                   // [factor][taps down][taps along]: how much a cell counts where it lies
  int factor;
  float likeness_per_difference;  // how much a grey level of difference, over three channels, takes away
  float least_likeness;           // of a cell that looks altogether different
  int count;  // cells along the row
  float* out;
};

// One row of brightness, (R + 2 G + B) / 4: means over 2 x unit rows and unit columns, smoothed along the row by 1 2 1.
struct BrightnessRow {
  const uint8_t* channel[3];  // the first of the rows
  ptrdiff_t stride;
  int unit;
  int count;       // of the output
  float* scratch;  // count values
  float* out;
};

// Cells, to each side, of the window in which two views are compared.
constexpr int correlation_reach = 5;
constexpr int correlation_window = 2 * correlation_reach + 1;

// Weight of a cell of the window, along a row and along a column. It falls towards the edge, so that one bright spot does
// not leave the square of a window behind.
constexpr int correlation_weight(int place) { return place < correlation_reach ? place + 1 : correlation_window - place; }

// All weights of a window: those along a row add up to the square of the largest one, and so do those along a column.
constexpr double correlation_weights = double{correlation_weight(correlation_reach)} * correlation_weight(correlation_reach) *
                                       correlation_weight(correlation_reach) * correlation_weight(correlation_reach);

// How many cells of one weight tell as much as a window does: its weights squared over the sum of their squares, (36 * 36 / 146)^2.
constexpr double correlation_cells = 79.0;

// Sums over a window: how many cells have a match, left, right, their squares, their product.
constexpr int correlation_sums = 6;

// One row of cells, each two columns wide: the left view, and the right one where it was matched, summed along the row.
struct MatchRow {
  const float* left;  // rows of brightness
  const float* right;
  int columns;  // of these; at least 2
  const float* disparity;  // of each cell, columns
  int cells;
  float* scratch;  // correlation_sums * (cells + 2 * correlation_reach) values
  float* sums;     // correlation_sums planes of `cells` values
};

// How well the views agree in each cell of a row.
struct CorrelationRow {
  const float* sums[correlation_window];  // the rows of the window; zeros beyond the picture
  const float* disparity[3];              // of the row above, this one and the one below, with a cell more at both ends
  int cells;
  float left_noise;  // variance
  float right_noise;
  float* correlation;  // of what is no noise, -1..1; not a number where nothing can be compared
  float* support;      // share of the network's confidence that the pictures leave, 0..1
  float* odds;         // by which the odds of an answer are multiplied: above 1 where the disparity is even, below at edges
};

// What the pictures make of the network's confidence in one row of its grid.
struct TrustRow {
  const float* confidence;  // of an error up to one pixel of the network
  const float* support;     // as above, at the places of the confidence
  const float* odds;
  int count;
  float reach;  // pixels of the network
  float* seen;  // of an error up to `reach` of them
  float* own;   // of one up to one of them, and without the odds
};

// Cells along a side of the tiles whose roughness tells texture.
constexpr int tile_cells = 8;

// One row of tiles, and of each the variance of its cells beside the plane through them.
struct TileRow {
  const float* levels;  // of the first row of cells
  ptrdiff_t stride;
  int tiles;
  float* roughness;
};

// A patch of cells that is looked for in another view.
constexpr int patch_reach_along = 5;
constexpr int patch_reach_down = 4;
constexpr int patch_width = 2 * patch_reach_along + 1;
constexpr int patch_cells = patch_width * (2 * patch_reach_down + 1);

// Sums of its products with the view, whose first cell lies under the patch's first one, then one cell further on, and so on.
struct PatchProducts {
  const float* patch;
  const float* view;
  ptrdiff_t stride;
  int count;
  float* out;
};

// Pixels along a side of a patch whose motion is followed.
constexpr int motion_patch = 8;

// Sums of a Lucas-Kanade step: how many cells count, the left view's gradients along x and y, the difference of the views,
// and the products of these three.
constexpr int row_step_sums = 9;

// One row of cells, each two columns wide, compared with the right view at the disparity found and `offset` rows lower.
struct RowStepRow {
  const float* left;  // first rows of brightness; row - 1 and row + 1 lie inside
  const float* right;
  int columns;  // at least 2, like rows
  int rows;
  int row;
  int cells;
  const float* disparity;  // of each cell, columns
  const float* offset;
  const float* wanted;  // 1 for cells that count, 0 for others
  float* sums;          // row_step_sums planes of `cells` values, which are added to; cell 0 is left out
};

// Cells of a window, three rows of three, all of which must count.
constexpr int row_window_cells = 9;

// What the sums tell of windows, the first around cell 1, one every other cell.
struct RowWindows {
  const float* sums;  // of a row_step_row for each of the rows
  int cells;
  int count;    // of windows; 2 * count < cells
  float ridge;  // keeps windows without gradients along x from dividing by zero
  // Of information, which is the gradients along y that a wrong disparity does not explain: up to the least a window tells
  // nothing, from enough on more tells little more.
  float least_information;
  float enough_information;
  float longest_step;  // longer ones are wrong
  float* step;    // rows that the match lies lower; 0 where the window tells nothing
  float* weight;  // 0 where the window tells nothing, up to 1
};

// Numbers that a robust fit of lines finds, and how many sums that takes: products of all two terms, the second not after
// the first, then products of each with the rest.
constexpr int fit_terms = 5;
constexpr int fit_sums = fit_terms * (fit_terms + 1) / 2 + fit_terms;
constexpr int fit_lanes = 8;

// What a measurement counts by what is left of it: all the same; what is farther off than `limit` less, and what is so far
// off less and less, up to nothing.
enum class Robust { none, huber, tukey };

struct FitSums {
  const float* terms[fit_terms];  // of each measurement
  const float* rest;
  const float* weight;
  int count;  // a multiple of fit_lanes
  float step[fit_terms];  // of which what is left is taken
  float limit;
  Robust robust;  // none: the weights count as 1, where they are not 0, and the rest as 1
  double* sums;
};

// Every kernel, written once: what it returns, its name, what it takes. `Kernels` and all its sets are made of this.
#define ENDOSDK_FOR_EACH_KERNEL(KERNEL)                                                                                \
  /* One row of means over blocks of factor x factor pixels, rounded half up; `source` is their first row. */          \
  KERNEL(void, reduce_row, (const uint8_t* source, ptrdiff_t stride, const Reduction& reduction,                       \
                            uint16_t* scratch, uint8_t* out))                                                          \
  /* Bilinear samples of an interleaved image, to one plane per channel. Three-channel kernels read 16 bytes from a    \
     left neighbour on, gray ones 4; whoever makes the spans sees to it that these lie inside the row (`remap_reach`). */ \
  KERNEL(void, remap_rgb, (const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1,          \
                           uint8_t* c2))                                                                               \
  KERNEL(void, remap_gray, (const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out))                    \
  /* Interleaved to planar. */                                                                                         \
  KERNEL(void, split_rgb, (const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2))                   \
  /* value[i] = gain * (upper[i] + weight * (lower[i] - upper[i])), step[i] = value[i + 1] - value[i], at the end 0. */ \
  KERNEL(void, blend_rows, (const float* upper, const float* lower, float weight, float gain, int count,               \
                            float* value, float* step))                                                                \
  /* out[x] = value[index[x]] + weight[x] * step[index[x]]. `index` never falls; `value` and `step` may be read, not   \
     used, up to stretch_reach elements from the first index of a group on. */                                         \
  KERNEL(void, stretch_row, (const float* value, const float* step, const int32_t* index, const float* weight,         \
                             int count, float* out))                                                                   \
  /* Means of `count` cells of factor x factor pixels of one channel. */                                               \
  KERNEL(void, mean_cells, (const uint8_t* rows, ptrdiff_t stride, int factor, int count, float* out))                 \
  /* How much a cell's disparity is worth, see sharpness.hpp, and that times the disparity. */                         \
  KERNEL(void, trust_cells, (const float* disparity, const float* confidence, int count, float* trust,                 \
                             float* trusted))                                                                          \
  /* What the structs above say. */                                                                                    \
  KERNEL(void, joint_bilateral_row, (const JointBilateralRow& row))                                                    \
  KERNEL(void, brightness_row, (const BrightnessRow& row))                                                             \
  /* Sizes of the mixed second difference at pixels 1 to count - 2 of a row between two others. */                     \
  KERNEL(void, noise_row, (const uint8_t* above, const uint8_t* here, const uint8_t* below, int count, uint16_t* out))  \
  KERNEL(void, tile_row, (const TileRow& row))                                                                         \
  KERNEL(void, match_row, (const MatchRow& row))                                                                       \
  KERNEL(void, correlation_row, (const CorrelationRow& row))                                                           \
  KERNEL(void, trust_row, (const TrustRow& row))                                                                       \
  /* Adds values, their squares and how many there are, each to its own column; what is no number is left out. */      \
  KERNEL(void, add_known, (const float* values, int count, float* sums, float* squares, float* known))                 \
  KERNEL(void, patch_products, (const PatchProducts& row))                                                            \
  /* A patch whose first value lies so far after and below the map's first, 0..1, about its mean. */                   \
  KERNEL(void, blend_patch, (const float* map, ptrdiff_t stride, float along, float down, float* out))                 \
  /* What two patches differ by, times the first one's slopes along x and along y: two sums. */                        \
  KERNEL(void, motion_sums, (const float* patch, const float* other, const float* along_x, const float* along_y,       \
                             float* sums))                                                                             \
  KERNEL(void, row_step_row, (const RowStepRow& row))                                                                 \
  KERNEL(void, row_windows, (const RowWindows& row))                                                                  \
  KERNEL(void, add_up_fit, (const FitSums& fit))                                                                      \
  KERNEL(void, interleave_row, (const uint8_t* c0, const uint8_t* c1, const uint8_t* c2, int count, uint8_t* out))     \
  /* Sums over three channels and two rows, `stride` apart, times `share`. */                                          \
  KERNEL(void, pair_brightness, (const uint8_t* const* channel, ptrdiff_t stride, int count, float share, float* out)) \
  KERNEL(void, smaller_row, (const SmallerRow& row))                                                                   \
  KERNEL(void, compare_row, (const CompareRow& row))                                                                   \
  KERNEL(void, solve_row, (const SolveRow& row))                                                                       \
  KERNEL(void, extremes_row, (const ExtremesRow& row))                                                                 \
  KERNEL(void, soft_argmin_cells, (const SoftArgminCells& cells))                                                      \
  KERNEL(void, choose_row, (const ChooseRow& row))                                                                     \
  KERNEL(void, add_rig_sigma, (const RigSigmaRow& row))                                                                \
  /* Returns the number of pixels without a reason. */                                                                 \
  KERNEL(int, depth_row, (const DepthRow& row, const DepthLimits& limits))

struct Kernels {
  const char* name;
#define ENDOSDK_POINTER(result, name, parameters) result(*name) parameters;
  ENDOSDK_FOR_EACH_KERNEL(ENDOSDK_POINTER)
#undef ENDOSDK_POINTER
};

// The set in use: the best this processor has, unless another was chosen.
const Kernels& kernels();

// Whether this processor has vector instructions for 8-bit integers (AVX2 or later; dot products of ARMv8.2). Without
// them, networks of 8-bit integers are slower than those of floats.
bool has_integer_units();

// The i-th set of this build, best first, whether this processor runs it or not; null beyond the last.
const char* kernel_set(int i);

// Chooses a set by name; refuses one that this processor cannot run.
void choose_kernels(const char* name);

}  // namespace endosdk
