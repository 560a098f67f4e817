// The bilinear sample that every remap kernel computes, in the integers that the vector kernels use.
#pragma once

#include <cstdint>

namespace endosdk {

// Neighbours are 0..255, fractions 0..127 in 1/128 px. Pixels are centred on zero, so that products fit 16 bits. The upper and
// the lower row are interpolated exactly. The step between them is rounded to 1/128 grey level.
static inline uint8_t sample(int upper_left, int upper_right, int lower_left, int lower_right, int fx, int fy) {
  const int upper = (upper_left - 128) * (128 - fx) + (upper_right - 128) * fx;
  const int lower = (lower_left - 128) * (128 - fx) + (lower_right - 128) * fx;
  const int value = upper + (((lower - upper) * (fy * 256) + 0x4000) >> 15);
  return static_cast<uint8_t>(((value + 64) >> 7) + 128);
}

}  // namespace endosdk
