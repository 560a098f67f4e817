// Means over blocks of pixels. The file is compiled once per instruction set: plain loops that the compiler vectorises. Blocks
// are processed in chunks whose sums stay in the first cache.
#include <string.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

// out[i] = sum of `count` values that lie `step` apart, from i on. The usual counts are known to the compiler.
template <int known, typename From>
inline void add_up(const From* __restrict values, ptrdiff_t step, int count, int length, uint16_t* __restrict out) {
  if (known == 4) {
    for (int i = 0; i < length; ++i) {
      out[i] = static_cast<uint16_t>((values[i] + values[i + step]) + (values[i + 2 * step] + values[i + 3 * step]));
    }
    return;
  }
  for (int i = 0; i < length; ++i) out[i] = static_cast<uint16_t>(values[i] + values[i + step]);
  if (known == 2) return;
  for (int k = 2; k < count; ++k) {
    const From* const further = values + k * step;
    for (int i = 0; i < length; ++i) out[i] = static_cast<uint16_t>(out[i] + further[i]);
  }
}

template <typename From>
void add_apart(const From* values, ptrdiff_t step, int count, int length, uint16_t* out) {
  switch (count) {
    case 2: return add_up<2>(values, step, count, length, out);
    case 4: return add_up<4>(values, step, count, length, out);
    default: return add_up<0>(values, step, count, length, out);
  }
}

// Picks the first pixel of each block: what was added up for the others is not wanted.
void pick(const uint16_t* __restrict totals, int factor, int channels, int width, uint16_t* __restrict out) {
  if (channels == 1) {
    for (int x = 0; x < width; ++x) out[x] = totals[x * factor];
  } else {
    for (int x = 0; x < width; ++x) memcpy(out + 3 * x, totals + 3 * factor * x, 3 * sizeof(uint16_t));
  }
}

// Divides and rounds half up. Sums are below 2^16 and counts are at most 256. So the quarter is enough that the product for an
// exact multiple does not fall below it, and too small to lift any other sum.
void divide(const uint16_t* __restrict sums, int count, int length, uint8_t* __restrict out) {
  const float offset = static_cast<float>(count / 2) + 0.25f;
  const float share = 1.0f / static_cast<float>(count);
  for (int i = 0; i < length; ++i) {
    out[i] = static_cast<uint8_t>(static_cast<int32_t>((static_cast<float>(sums[i]) + offset) * share));
  }
}

}  // namespace

void reduce_row(const uint8_t* source, ptrdiff_t stride, const Reduction& reduction, uint16_t* scratch, uint8_t* out) {
  const int factor = reduction.factor;
  const int channels = reduction.channels;
  const int chunk = reduction_chunk;
  for (int first = 0; first < reduction.width; first += chunk) {
    const int width = reduction.width - first < chunk ? reduction.width - first : chunk;
    const int values = width * factor * channels;
    uint16_t* const sums = scratch;
    uint16_t* const totals = scratch + values;
    add_apart(source + static_cast<ptrdiff_t>(first) * factor * channels, stride, factor, values, sums);
    add_apart(sums, channels, factor, values - (factor - 1) * channels, totals);
    pick(totals, factor, channels, width, sums);  // the sums are no longer needed
    divide(sums, factor * factor, width * channels, out + static_cast<ptrdiff_t>(first) * channels);
  }
}

}  // namespace endosdk::ENDOSDK_ISA
