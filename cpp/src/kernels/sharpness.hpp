// The relation between a confidence and the expected error.
#pragma once

#include <stdint.h>
#include <string.h>

namespace endosdk {

// -log(1 - c) for c in [1e-6, 1 - 1e-6], with a relative error below 4e-7. The rounding error of 1 - c is added back, because
// for small c it is most of the result.
static inline float negative_log1m(float c) {
  const float rest = 1.0f - c;
  const float lost = (1.0f - rest) - c;
  int32_t bits;
  memcpy(&bits, &rest, sizeof(bits));
  const int32_t exponent = (bits - 0x3f3504f3) >> 23;  // so that the mantissa lies between sqrt(1/2) and sqrt(2)
  const int32_t mantissa_bits = bits - exponent * (1 << 23);
  float mantissa;
  memcpy(&mantissa, &mantissa_bits, sizeof(mantissa));
  const float f = mantissa - 1.0f;
  // Minimax fit of (log(1 + f) - f + f^2/2) / f^3.
  float p = 8.918753266e-02f;
  p = p * f - 1.434965730e-01f;
  p = p * f + 1.487639099e-01f;
  p = p * f - 1.656569391e-01f;
  p = p * f + 1.996546388e-01f;
  p = p * f - 2.500174642e-01f;
  p = p * f + 3.333385587e-01f;
  const float log_mantissa = f - 0.5f * f * f + f * f * f * p;
  const float ln2 = 0.69314718f;
  return -(static_cast<float>(exponent) * ln2 + (log_mantissa + lost));
}

// 1 - exp(-t) for t >= 0, with an error below 2e-7.
static inline float one_minus_exp(float t) {
  const float x = -1.44269504f * (t < 80.0f ? t : 80.0f);
  const float whole = static_cast<float>(static_cast<int32_t>(x - 0.5f));
  const float f = (x - whole) * 0.69314718f;  // at most half of ln 2 from 0
  // Taylor's series: in this range the term of the seventh power is below 1e-7.
  float p = 1.0f / 720.0f;
  p = p * f + 1.0f / 120.0f;
  p = p * f + 1.0f / 24.0f;
  p = p * f + 1.0f / 6.0f;
  p = p * f + 0.5f;
  p = p * f + 1.0f;
  const float rest = p * f;  // exp(f) - 1; for small t it is the whole result
  const int32_t bits = (static_cast<int32_t>(whole) + 127) << 23;
  float power;
  memcpy(&power, &bits, sizeof(power));
  return (1.0f - power) - power * rest;
}

// Probability of an error up to `reach` units, in the Laplace law in which an error up to one unit has the probability
// `confidence`: 1 - (1 - confidence)^reach. NaN stays NaN.
static inline float confidence_within(float confidence, float reach) {
  constexpr float most = 1.0f - 1.0f / (1 << 24);
  const float c = confidence > 0.0f ? (confidence < most ? confidence : most) : 0.0f;
  const float within = one_minus_exp(reach * negative_log1m(c));
  return confidence == confidence ? within : confidence;
}

// 1 / scale, in units, of the Laplace law in which an error up to one unit has the probability `confidence`. NaN counts as the
// least confidence.
static inline float sharpness(float confidence) {
  constexpr float least = 1e-6f;
  constexpr float most = 1.0f - 1e-6f;
  float c = confidence > least ? confidence : least;
  c = c < most ? c : most;
  return negative_log1m(c);
}

}  // namespace endosdk
