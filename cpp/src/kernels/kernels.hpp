// The kernels: inner loops over one image row or less. They exist for several instruction sets, which all give the same bytes.
//
// The implementations are compiled with the flags of their instruction set. The linker must never use such code for the rest of
// the program. So these files define no inline or template functions with external linkage, and include no file that does. They
// include only the headers of this folder, <cstdint>, <cstddef>, <string.h> and the intrinsics.
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

// Each left neighbour must be at least this many pixels before the end of its row, itself included.
constexpr int remap_reach = 6;

constexpr int stretch_reach = 16;

// One row of the full-size maps: inputs, and the outputs to compute. An output that is not wanted is null.
struct DepthRow {
  const float* disparity;
  const float* confidence;
  const float* own_confidence;  // of the network, for sigma
  const uint8_t* brightness;  // least channel of the left view; null: not tested
  const uint8_t* inside_left;  // field of view; null: the whole row
  const uint8_t* valid_left;
  const uint8_t* valid_right;
  uint8_t* reasons;
  float* depth;
  float* sigma;
  int width;
};

struct DepthLimits {
  float min_confidence;
  float disparity_begin;  // frame px: up to this, an error of the network is as large as the disparity
  float disparity_end;    // frame px: from this on, the network finds nothing; may be infinite
  bool metric;           // if false, the members below are not used
  float focal_baseline;  // px * mm
  float doffs;           // px
  float min_depth;       // mm
  float max_depth;       // mm
  float sigma_factor;    // sigma = sigma_factor * depth^2 / -log(1 - own confidence)
};

// One row of sigma, to whose square the error of a rig that has moved is added: depth^4 * (constant + per_square * u^2 +
// per_fourth * (1 + u^2)^2), where u = start + step * column.
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

// Output pixels that a reduction computes together.
constexpr int reduction_chunk = 64;

// Reduction of interleaved rows by a whole factor, 2 to 16.
struct Reduction {
  int factor;
  int channels;  // 1 or 3
  int width;     // of the output, pixels

  // Number of 16-bit values of scratch memory.
  int scratch() const { return 2 * reduction_chunk * factor * channels; }
};

// Number of cells along each axis from which a pixel's disparity is upsampled.
constexpr int joint_bilateral_taps = 6;

// Planes of a row of cells: red, green, blue, trust, and trust times disparity.
constexpr int joint_bilateral_planes = 5;

// One row of an upsampled map on the grid of a view. A cell has factor x factor pixels of the view.
struct JointBilateralRow {
  const uint8_t* view[3];                               // red, green, blue
  const float* cells[joint_bilateral_taps][joint_bilateral_planes];       // the rows of cells around it
  const int* start;                                     // offset of the first cell, for each phase of a pixel within its cell
  const float* share;                                   // [factor][taps down][taps along]: weight of a cell by its distance
  int factor;
  float likeness_per_difference;  // loss of likeness per grey level of difference, summed over three channels
  float least_likeness;           // likeness of cells with very different colours
  int count;  // cells along the row
  float* out;
};

// One row of brightness, (R + 2 G + B) / 4: means over 2 x unit rows and `unit` columns, smoothed along the row by 1 2 1.
struct BrightnessRow {
  const uint8_t* channel[3];  // first row of each channel
  ptrdiff_t stride;
  int unit;
  int count;       // values of the output
  float* scratch;  // count values
  float* out;
};

// Cells on each side of the centre of the window in which two views are compared.
constexpr int correlation_reach = 5;
constexpr int correlation_window = 2 * correlation_reach + 1;

// Weight of a cell of the window, along a row and along a column. It falls towards the edge, so that a single bright spot does
// not appear as a square of the size of a window.
constexpr int correlation_weight(int place) { return place < correlation_reach ? place + 1 : correlation_window - place; }

// Sum of all weights of a window. The weights along a row add up to the square of the largest one, as do those along a column.
constexpr double correlation_weights = double{correlation_weight(correlation_reach)} * correlation_weight(correlation_reach) *
                                       correlation_weight(correlation_reach) * correlation_weight(correlation_reach);

// Number of cells of equal weight that tell as much as a window: the squared sum of its weights over the sum of their squares,
// (36 * 36 / 146)^2.
constexpr double correlation_cells = 79.0;

// Sums over a window: number of cells with a match, left, right, left squared, right squared, left times right.
constexpr int correlation_sums = 6;

// One row of cells, each two columns wide. The left view, and the right view where it was matched, are summed along the row.
struct MatchRow {
  const float* left;  // rows of brightness
  const float* right;
  int columns;  // of `left` and `right`; at least 2
  const float* disparity;  // of each cell, columns
  int cells;
  float* scratch;  // correlation_sums * (cells + 2 * correlation_reach) values
  float* sums;     // correlation_sums planes of `cells` values
};

// Cells on every side of a cell that decide whether it lies at a jump of the disparity.
constexpr int edge_reach = 3;
constexpr int edge_window = 2 * edge_reach + 1;

// How well the views agree in each cell of a row.
struct CorrelationRow {
  const float* sums[correlation_window];  // the rows of the window; zeros outside the picture
  const float* disparity[edge_window];    // this row and those around it, each with edge_reach more cells at both ends
  int cells;
  float left_noise;  // variance
  float right_noise;
  float* correlation;  // correlation without the noise, -1..1; NaN where nothing can be compared
  float* support;      // share of the network's confidence that the pictures leave, 0..1
  float* odds;         // factor on the odds of an answer: above 1 where the disparity is even, below 1 at jumps
};

// One row of the network's confidence, and the confidences that follow from it and the pictures.
struct TrustRow {
  const float* confidence;  // probability of an error up to one network pixel
  const float* support;     // see CorrelationRow, at the places of the confidence
  const float* odds;
  int count;
  float reach;  // network pixels
  float* seen;  // probability of an error up to `reach`
  float* own;   // probability of an error up to one network pixel, without the odds
};

// Cells along a side of a tile. The roughness of tiles shows texture.
constexpr int tile_cells = 8;

// One row of tiles. The roughness of a tile is the variance of its cells about a plane fitted to them.
struct TileRow {
  const float* levels;  // first row of cells
  ptrdiff_t stride;
  int tiles;
  float* roughness;
};

// Size of a patch of cells that is searched in the other view.
constexpr int patch_reach_along = 5;
constexpr int patch_reach_down = 4;
constexpr int patch_width = 2 * patch_reach_along + 1;
constexpr int patch_cells = patch_width * (2 * patch_reach_down + 1);

// Sums of the products of a patch with the view, at `count` places. At the first place, the first cell of the patch lies on
// `view`. Each further place is one cell further along the row.
struct PatchProducts {
  const float* patch;
  const float* view;
  ptrdiff_t stride;
  int count;
  float* out;
};

// Pixels along a side of a patch whose motion is followed.
constexpr int motion_patch = 8;

// Sums of a Lucas-Kanade step: number of cells that count, gradients of the left view along x and y, difference of the views,
// and the products x x, x y, y y, x difference and y difference.
constexpr int row_step_sums = 9;

// One row of cells, each two columns wide. It is compared with the right view at the found disparity, `offset` rows lower.
struct RowStepRow {
  const float* left;  // first row of brightness; row - 1 and row + 1 must lie inside
  const float* right;
  int columns;  // at least 2, as `rows`
  int rows;
  int row;
  int cells;
  const float* disparity;  // of each cell, columns
  const float* offset;
  const float* wanted;  // 1 for cells that count, 0 for others
  float gain;           // factor on the right view
  float* sums;          // row_step_sums planes of `cells` values; the kernel adds to them; cell 0 is left out
};

// Number of cells of a window: three rows of three. All of them must count.
constexpr int row_window_cells = 9;

// Solves windows from their sums. The first window is around cell 1, and there is one at every second cell.
struct RowWindows {
  const float* sums;  // of row_step_row, over the three rows of the windows
  int cells;
  int count;    // windows; 2 * count < cells
  float ridge;  // keeps windows without gradients along x from dividing by zero
  // Information is the part of the gradients along y that a wrong disparity does not explain. With at most `least_information`,
  // a window tells nothing. From `enough_information` on, more information tells little more.
  float least_information;
  float enough_information;
  float longest_step;  // longer steps are taken for wrong
  float* step;    // rows by which the match lies lower; 0 where the window tells nothing
  float* weight;  // 0 where the window tells nothing, up to 1
};

// Number of terms of a robust linear fit, and number of its sums. The sums are the products of each term with itself and the
// terms before it, then the products of each term with the rest.
constexpr int fit_terms = 6;
constexpr int fit_sums = fit_terms * (fit_terms + 1) / 2 + fit_terms;
constexpr int fit_lanes = 8;

// How the weight of a measurement depends on its residual. none: all count the same. huber: residuals beyond `limit` count
// less. tukey: the weight falls steadily, and is 0 from `limit` on.
enum class Robust { none, huber, tukey };

struct FitSums {
  const float* terms[fit_terms];  // values of each measurement
  const float* rest;
  const float* weight;
  int count;  // a multiple of fit_lanes
  float step[fit_terms];  // residuals are computed for this step
  float limit;
  Robust robust;  // none: each weight that is not 0 counts as 1, and each rest as 1
  double* sums;
};

// The list of all kernels: result, name and parameters. `Kernels` and all sets are generated from it.
#define ENDOSDK_FOR_EACH_KERNEL(KERNEL)                                                                                \
  /* Means over one row of blocks of factor x factor pixels, rounded half up. `source` is the first pixel row. */      \
  KERNEL(void, reduce_row, (const uint8_t* source, ptrdiff_t stride, const Reduction& reduction,                       \
                            uint16_t* scratch, uint8_t* out))                                                          \
  /* Bilinear samples of an interleaved image, to one plane per channel. From each left neighbour on, three-channel    \
     kernels read 16 bytes, gray kernels 4. Whoever makes the spans keeps these inside the row (`remap_reach`). */     \
  KERNEL(void, remap_rgb, (const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1,          \
                           uint8_t* c2))                                                                               \
  KERNEL(void, remap_gray, (const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out))                    \
  /* Splits interleaved pixels into planes. */                                                                         \
  KERNEL(void, split_rgb, (const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2))                   \
  /* value[i] = gain * (upper[i] + weight * (lower[i] - upper[i])), step[i] = value[i + 1] - value[i], last step 0. */ \
  KERNEL(void, blend_rows, (const float* upper, const float* lower, float weight, float gain, int count,               \
                            float* value, float* step))                                                                \
  /* out[x] = value[index[x]] + weight[x] * step[index[x]]. `index` never decreases. Kernels may read up to            \
     stretch_reach elements of `value` and `step` from the first index of a group on, without using them. */           \
  KERNEL(void, stretch_row, (const float* value, const float* step, const int32_t* index, const float* weight,         \
                             int count, float* out))                                                                   \
  /* Means of `count` cells of factor x factor pixels of one channel. */                                               \
  KERNEL(void, mean_cells, (const uint8_t* rows, ptrdiff_t stride, int factor, int count, float* out))                 \
  /* The weight (trust) of each cell's disparity, see sharpness.hpp, and this weight times the disparity. */           \
  KERNEL(void, trust_cells, (const float* disparity, const float* confidence, int count, float* trust,                 \
                             float* trusted))                                                                          \
  /* Kernels that take a struct are described at the struct. */                                                        \
  KERNEL(void, joint_bilateral_row, (const JointBilateralRow& row))                                                    \
  KERNEL(void, brightness_row, (const BrightnessRow& row))                                                             \
  /* Absolute mixed second difference at pixels 1 to count - 2 of row `here`. */                                       \
  KERNEL(void, noise_row, (const uint8_t* above, const uint8_t* here, const uint8_t* below, int count, uint16_t* out))  \
  KERNEL(void, tile_row, (const TileRow& row))                                                                         \
  KERNEL(void, match_row, (const MatchRow& row))                                                                       \
  KERNEL(void, correlation_row, (const CorrelationRow& row))                                                           \
  KERNEL(void, trust_row, (const TrustRow& row))                                                                       \
  /* Adds each value, its square and the count 1 to the sums of its column. NaN is left out. */                        \
  KERNEL(void, add_known, (const float* values, int count, float* sums, float* squares, float* known))                 \
  KERNEL(void, patch_products, (const PatchProducts& row))                                                            \
  /* Reads a patch, less its mean. Its first value lies `along` after and `down` below the map's first, both 0..1. */  \
  KERNEL(void, blend_patch, (const float* map, ptrdiff_t stride, float along, float down, float* out))                 \
  /* Two sums: the difference of two patches times the slope of the first one, along x and along y. */                 \
  KERNEL(void, motion_sums, (const float* patch, const float* other, const float* along_x, const float* along_y,       \
                             float* sums))                                                                             \
  KERNEL(void, row_step_row, (const RowStepRow& row))                                                                 \
  KERNEL(void, row_windows, (const RowWindows& row))                                                                  \
  KERNEL(void, add_up_fit, (const FitSums& fit))                                                                      \
  KERNEL(void, interleave_row, (const uint8_t* c0, const uint8_t* c1, const uint8_t* c2, int count, uint8_t* out))     \
  /* Sums over three channels and two rows, times `share`. The rows are `stride` apart. */                             \
  KERNEL(void, pair_brightness, (const uint8_t* const* channel, ptrdiff_t stride, int count, float share, float* out)) \
  KERNEL(void, smaller_row, (const SmallerRow& row))                                                                   \
  KERNEL(void, compare_row, (const CompareRow& row))                                                                   \
  KERNEL(void, solve_row, (const SolveRow& row))                                                                       \
  KERNEL(void, extremes_row, (const ExtremesRow& row))                                                                 \
  KERNEL(void, soft_argmin_cells, (const SoftArgminCells& cells))                                                      \
  KERNEL(void, choose_row, (const ChooseRow& row))                                                                     \
  KERNEL(void, thin_row, (const ThinRow& row))                                                                         \
  KERNEL(void, add_bytes, (const uint8_t* a, const uint8_t* b, const SumOfBytes& steps, int count, uint8_t* out))      \
  KERNEL(void, confidence_row, (const ConfidenceRow& row))                                                             \
  /* The logarithm of share * value + added, which must be a positive normal number. */                                \
  KERNEL(void, log_row, (const float* values, float share, float added, int count, float* out))                        \
  KERNEL(void, add_rig_sigma, (const RigSigmaRow& row))                                                                \
  /* Returns the number of pixels without a reason. */                                                                 \
  KERNEL(int, depth_row, (const DepthRow& row, const DepthLimits& limits))

struct Kernels {
  const char* name;
#define ENDOSDK_POINTER(result, name, parameters) result(*name) parameters;
  ENDOSDK_FOR_EACH_KERNEL(ENDOSDK_POINTER)
#undef ENDOSDK_POINTER
};

// The set in use: the best one that this processor can run, unless another was chosen.
const Kernels& kernels();

// Whether this processor has vector instructions for 8-bit integers (AVX2 or later; dot products of ARMv8.2). Without them,
// 8-bit networks are slower than float32 networks.
bool has_integer_units();

// Name of the i-th set of this build, best first, even if this processor cannot run it. Null after the last set.
const char* kernel_set(int i);

// Chooses a set by name. Throws if this processor cannot run it.
void choose_kernels(const char* name);

}  // namespace endosdk
