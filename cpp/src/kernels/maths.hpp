// Limits, exponential and logarithm for all kernel sets. The steps are the same in every set, so that all sets round alike. There are
// no branches, so that the compiler can use vectors.
#pragma once

#include <stdint.h>
#include <string.h>

namespace endosdk {

static inline float float_of_bits(int32_t bits) {
  float value;
  memcpy(&value, &bits, sizeof(value));
  return value;
}

static inline int32_t bits_of_float(float value) {
  int32_t bits;
  memcpy(&bits, &value, sizeof(bits));
  return bits;
}

static inline float at_most(float value, float limit) { return value < limit ? value : limit; }
static inline float at_least(float value, float limit) { return value > limit ? value : limit; }

// exp(x) with a relative error below 3e-7. Arguments are limited to -87 and 88.
static inline float exp_of(float x) {
  const float low = x > -87.0f ? x : -87.0f;  // NaN becomes -87
  const float within = low < 88.0f ? low : 88.0f;
  constexpr float to_whole = 12582912.0f;  // 1.5 * 2^23: adding it removes the fraction
  const float twos = (within * 1.44269504f + to_whole) - to_whole;
  // ln 2 in two parts. The first part has so few digits that its products with whole numbers are exact.
  const float rest = (within - twos * 0.693359375f) + twos * 2.12194440e-4f;
  // Taylor's series, for |rest| < 0.35.
  float sum = 1.0f / 5040.0f;
  sum = sum * rest + 1.0f / 720.0f;
  sum = sum * rest + 1.0f / 120.0f;
  sum = sum * rest + 1.0f / 24.0f;
  sum = sum * rest + 1.0f / 6.0f;
  sum = sum * rest + 0.5f;
  sum = sum * rest + 1.0f;
  sum = sum * rest + 1.0f;
  return sum * float_of_bits((static_cast<int32_t>(twos) + 127) * (1 << 23));
}

// Natural logarithm of a positive normal number. The error is below 3e-7, absolute or relative, whichever is larger.
static inline float log_of(float x) {
  const int32_t bits = bits_of_float(x);
  const float mantissa = float_of_bits((bits & 0x007fffff) | 0x3f800000);  // 1 to 2
  const bool large = mantissa > 1.41421356f;
  const float near_one = large ? 0.5f * mantissa : mantissa;
  const auto twos = static_cast<float>((bits >> 23) - 127 + (large ? 1 : 0));
  // log m = 2 artanh((m - 1) / (m + 1)).
  const float ratio = (near_one - 1.0f) / (near_one + 1.0f);
  const float square = ratio * ratio;
  float sum = 1.0f / 9.0f;
  sum = sum * square + 1.0f / 7.0f;
  sum = sum * square + 1.0f / 5.0f;
  sum = sum * square + 1.0f / 3.0f;
  return twos * 0.69314718f + 2.0f * ratio * (sum * square + 1.0f);
}

}  // namespace endosdk
