// Means over blocks of pixels. The file is compiled once per instruction set: plain loops that the compiler vectorises. All
// loops but the last work on every value of a row, wanted or not. The last loop picks the wanted values.
#include <string.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

// out[i] = sum over `count` values that lie `step` apart, from i on
void add_apart(const uint16_t* __restrict values, int step, int count, int length, uint16_t* __restrict out) {
  for (int i = 0; i < length; ++i) out[i] = static_cast<uint16_t>(values[i] + values[i + step]);
  for (int k = 2; k < count; ++k) {
    const uint16_t* const further = values + static_cast<ptrdiff_t>(k) * step;
    for (int i = 0; i < length; ++i) out[i] = static_cast<uint16_t>(out[i] + further[i]);
  }
}

void add_rows(const uint8_t* source, ptrdiff_t stride, int count, int length, uint16_t* __restrict sums) {
  const uint8_t* const second = source + stride;
  for (int i = 0; i < length; ++i) sums[i] = static_cast<uint16_t>(source[i] + second[i]);
  for (int k = 2; k < count; ++k) {
    const uint8_t* const row = source + k * stride;
    for (int i = 0; i < length; ++i) sums[i] = static_cast<uint16_t>(sums[i] + row[i]);
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
  const int values = reduction.width * factor * channels;
  const int whole = values - (factor - 1) * channels;
  uint16_t* const sums = scratch;
  uint16_t* const totals = scratch + values;
  uint8_t* const means = reinterpret_cast<uint8_t*>(sums);  // the sums are no longer needed
  add_rows(source, stride, factor, values, sums);
  add_apart(sums, channels, factor, whole, totals);
  divide(totals, factor * factor, whole, means);
  if (channels == 1) {
    for (int x = 0; x < reduction.width; ++x) out[x] = means[x * factor];
  } else {
    for (int x = 0; x < reduction.width; ++x) memcpy(out + 3 * x, means + 3 * factor * x, 3);
  }
}

}  // namespace endosdk::ENDOSDK_ISA
