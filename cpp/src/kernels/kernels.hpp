// The inner loops, one image row or less at a time, in several instruction sets that give the same bytes.
//
// The implementations are compiled with the flags of their instruction set. So that the linker can never pick such code
// for the rest of the program, those files define no inline or template functions with external linkage and include
// nothing that does: only this header, <cstdint>, <cstddef>, <string.h> and the intrinsics.
#pragma once

#include <cstddef>
#include <cstdint>

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
  const uint8_t* brightness;  // least channel of the left view; null: not tested
  const uint8_t* valid_left;
  const uint8_t* valid_right;
  uint8_t* reasons;
  float* depth;
  float* sigma;
  int width;
};

struct DepthLimits {
  float min_confidence;
  float disparity_end;  // frame px: there and beyond the network finds nothing; may be infinite
  bool metric;           // the rest holds only if true
  float focal_baseline;  // px * mm
  float doffs;           // px
  float min_depth;       // mm
  float max_depth;       // mm
  float sigma_factor;    // sigma = sigma_factor * depth^2 / -log(1 - confidence)
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

struct Kernels {
  const char* name;

  // One row of means over blocks of factor x factor pixels, rounded half up; `source` is the first row of the blocks.
  void (*reduce_row)(const uint8_t* source, ptrdiff_t stride, const Reduction& reduction, uint16_t* scratch,
                     uint8_t* out);

  // Bilinear samples of an interleaved image, to one plane per channel. Three-channel kernels read 16 bytes from a
  // left neighbour on, gray ones 4; whoever makes the spans sees to it that these lie inside the row (`remap_reach`).
  void (*remap_rgb)(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1, uint8_t* c2);
  void (*remap_gray)(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out);

  // Interleaved to planar.
  void (*split_rgb)(const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2);

  // value[i] = gain * (upper[i] + weight * (lower[i] - upper[i])) and step[i] = value[i + 1] - value[i], zero at the end.
  void (*blend_rows)(const float* upper, const float* lower, float weight, float gain, int count, float* value,
                     float* step);
  // out[x] = value[index[x]] + weight[x] * step[index[x]]. `index` never falls; `value` and `step` may be read, not
  // used, up to stretch_reach elements from the first index of a group on.
  void (*stretch_row)(const float* value, const float* step, const int32_t* index, const float* weight, int count,
                      float* out);

  // Means of `count` cells of factor x factor pixels of one channel.
  void (*mean_cells)(const uint8_t* rows, ptrdiff_t stride, int factor, int count, float* out);
  // How much a cell's disparity is worth, see sharpness.hpp, and that times the disparity.
  void (*trust_cells)(const float* disparity, const float* confidence, int count, float* trust, float* trusted);
  void (*joint_bilateral_row)(const JointBilateralRow& row);

  // Returns the number of pixels without a reason.
  int (*depth_row)(const DepthRow& row, const DepthLimits& limits);
};

// The set in use: the best this processor has, unless another was chosen.
const Kernels& kernels();

// Whether this processor has vector instructions for 8-bit integers (AVX2 or later). Without them, networks of 8-bit
// integers are slower than those of floats.
bool has_integer_units();

// The i-th set of this build, best first, whether this processor runs it or not; null beyond the last.
const char* kernel_set(int i);

// Chooses a set by name; refuses one that this processor cannot run.
void choose_kernels(const char* name);

}  // namespace endosdk
