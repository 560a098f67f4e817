// Joint bilateral upsampling. The file is compiled once per instruction set: plain loops that the compiler vectorises. Cells
// are processed in chunks whose sums stay in the first cache. The usual cell sizes have their own loops, because the compiler
// can vectorise steps only if it knows their length.
#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"
#include "kernels/sharpness.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

constexpr int chunk = 64;
constexpr int taps = joint_bilateral_taps;

// How the likeness of colours is computed.
struct Colours {
  float per_difference;
  float least;
};

struct Sums {
  float weight[chunk];
  float value[chunk];
};

// Reads one channel of the pixels of a chunk: every factor-th pixel of the view's row.
inline void read_pixels(const uint8_t* row, int factor, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] = static_cast<float>(row[i * factor]);
}

inline void write_pixels(const Sums& sums, int factor, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i * factor] = sums.value[i] / sums.weight[i];
}

inline void mean(const uint8_t* rows, ptrdiff_t stride, int factor, int count, float* __restrict out) {
  const float share = 1.0f / static_cast<float>(factor * factor);
  for (int i = 0; i < count; ++i) {
    int sum = 0;
    for (int y = 0; y < factor; ++y) {
      for (int x = 0; x < factor; ++x) sum += rows[y * stride + i * factor + x];
    }
    out[i] = static_cast<float>(sum) * share;
  }
}

// Adds one row of cells. Pixel i takes cells i to i + taps - 1; `share` holds their weights by distance.
void add_cells(const float* __restrict red, const float* __restrict green, const float* __restrict blue,
               const float* __restrict trust, const float* __restrict trusted, const float* __restrict share,
               const float (&pixels)[3][chunk], Colours colours, int count, Sums& sums) {
  for (int i = 0; i < count; ++i) {
    float weight = sums.weight[i];
    float value = sums.value[i];
    for (int t = 0; t < taps; ++t) {
      const float difference = (__builtin_fabsf(red[i + t] - pixels[0][i]) + __builtin_fabsf(green[i + t] - pixels[1][i])) +
                               __builtin_fabsf(blue[i + t] - pixels[2][i]);
      float likeness = 1.0f - difference * colours.per_difference;
      likeness = likeness > 0.0f ? likeness : 0.0f;
      likeness = likeness * likeness;
      const float counts = share[t] * (likeness * likeness + colours.least);
      weight = weight + counts * trust[i + t];
      value = value + counts * trusted[i + t];
    }
    sums.weight[i] = weight;
    sums.value[i] = value;
  }
}

}  // namespace

void mean_cells(const uint8_t* rows, ptrdiff_t stride, int factor, int count, float* out) {
  switch (factor) {
    case 2: return mean(rows, stride, 2, count, out);
    case 4: return mean(rows, stride, 4, count, out);
    default: return mean(rows, stride, factor, count, out);
  }
}

void trust_cells(const float* disparity, const float* confidence, int count, float* __restrict trust,
                 float* __restrict trusted) {
  for (int i = 0; i < count; ++i) {
    trust[i] = sharpness(confidence[i]);
    trusted[i] = trust[i] * disparity[i];
  }
}

void joint_bilateral_row(const JointBilateralRow& row) {
  float pixels[3][chunk];
  Sums sums;
  const Colours colours = {row.likeness_per_difference, row.least_likeness};
  for (int phase = 0; phase < row.factor; ++phase) {
    for (int first = 0; first < row.count; first += chunk) {
      const int count = row.count - first < chunk ? row.count - first : chunk;
      for (int c = 0; c < 3; ++c) {
        const uint8_t* const view = row.view[c] + first * row.factor + phase;
        row.factor == 2 ? read_pixels(view, 2, count, pixels[c]) : read_pixels(view, row.factor, count, pixels[c]);
      }
      for (int i = 0; i < chunk; ++i) sums.weight[i] = sums.value[i] = 0.0f;
      for (int t = 0; t < taps; ++t) {
        const float* const* cells = row.cells[t];
        const ptrdiff_t at = first + row.start[phase];
        add_cells(cells[0] + at, cells[1] + at, cells[2] + at, cells[3] + at, cells[4] + at,
                  row.share + (phase * taps + t) * taps, pixels, colours, count, sums);
      }
      float* const out = row.out + first * row.factor + phase;
      row.factor == 2 ? write_pixels(sums, 2, count, out) : write_pixels(sums, row.factor, count, out);
    }
  }
}

}  // namespace endosdk::ENDOSDK_ISA
