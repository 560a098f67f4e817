// Depth, reasons and blending of rows, compiled once per instruction set: plain loops that the compiler vectorises. Contraction to fused
// multiply-add is off for the whole build and nothing is reassociated, so that every set rounds alike.
#include <string.h>

#include "../depth.hpp"
#include "kernels.hpp"
#include "sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

constexpr int chunk = 128;
constexpr float infinity = __builtin_inff();
constexpr float least_confidence = 1e-6f;
constexpr float most_confidence = 1.0f - 1e-6f;

// What one chunk of a row needs between its loops. The second half of `cover` stays infinite: the scan looks there.
struct Scratch {
  float match[chunk];      // column of the match in the right view; infinity where the disparity is not finite
  float cover[2 * chunk];  // leftmost match of this pixel and those to its right
  float depth[chunk];
};

// -log(1 - c) for c in [1e-6, 1 - 1e-6], within 4e-7 relative. What rounding of 1 - c loses is added back, because
// it is most of the answer where c is small.
inline float negative_log1m(float c) {
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

// Matches of one chunk that begins at column `first`, and for each the leftmost one from it to the right.
void find_matches(const float* disparity, int first, int count, Scratch& s) {
  for (int i = 0; i < count; ++i) {
    const float d = disparity[i];
    s.match[i] = __builtin_fabsf(d) < infinity ? static_cast<float>(first + i) - d : infinity;
  }
  for (int i = count; i < chunk; ++i) s.match[i] = infinity;
  memcpy(s.cover, s.match, sizeof(s.match));
  // Each pass doubles how far to the right a minimum has looked.
  for (int reach = 1; reach < chunk; reach *= 2) {
    for (int i = 0; i < chunk; ++i) {
      const float ahead = s.cover[i + reach];
      s.cover[i] = ahead < s.cover[i] ? ahead : s.cover[i];
    }
  }
}

void measure_depth(const float* disparity, int count, const DepthLimits& limits, Scratch& s) {
  for (int i = 0; i < count; ++i) s.depth[i] = limits.focal_baseline / (disparity[i] + limits.doffs);
}

// Conditions below are combined with & and |, not && and ||: a loop without branches is one that can be vectorised.

// `covered_from` is the leftmost match of all chunks to the right.
void give_reasons(const float* confidence, int count, float last, float covered_from, float min_confidence,
                  const Scratch& s, uint8_t* reasons) {
  for (int i = 0; i < count; ++i) {
    const float match = s.match[i];
    const float cover = s.cover[i] < covered_from ? s.cover[i] : covered_from;
    const int finite = match < infinity;
    int r = confidence[i] >= min_confidence ? 0 : low_confidence;
    r |= (finite & (cover < match - 1.0f)) ? occluded : 0;
    r |= (finite & ((match < 0.0f) | (match > last))) ? outside_overlap : 0;
    r |= finite ? 0 : out_of_range;
    reasons[i] = static_cast<uint8_t>(r);
  }
}

// The limits come by value: a byte store may change anything that a reference points to.
void add_range_reasons(const float* disparity, int count, const DepthLimits limits, const Scratch& s,
                       uint8_t* reasons) {
  for (int i = 0; i < count; ++i) {
    const float depth = s.depth[i];
    const int usable =
        (disparity[i] + limits.doffs > 0.0f) & (depth >= limits.min_depth) & (depth <= limits.max_depth);
    reasons[i] = static_cast<uint8_t>(reasons[i] | (usable ? 0 : out_of_range));
  }
}

void add_sign_reasons(const float* disparity, int count, uint8_t* reasons) {
  for (int i = 0; i < count; ++i) {
    reasons[i] = static_cast<uint8_t>(reasons[i] | (disparity[i] > 0.0f ? 0 : out_of_range));
  }
}

void add_glare_reasons(const uint8_t* brightness, int count, uint8_t* reasons) {
  for (int i = 0; i < count; ++i) {
    reasons[i] = static_cast<uint8_t>(reasons[i] | (brightness[i] >= saturation_level ? saturated : 0));
  }
}

void add_left_reasons(const uint8_t* valid, int count, uint8_t* reasons) {
  for (int i = 0; i < count; ++i) reasons[i] = static_cast<uint8_t>(reasons[i] | (valid[i] ? 0 : outside_overlap));
}

void add_right_reasons(const uint8_t* valid, int count, float last, const Scratch& s, uint8_t* reasons) {
  for (int i = 0; i < count; ++i) {
    if (!(s.match[i] >= 0.0f && s.match[i] <= last)) continue;
    const int nearest = static_cast<int>(s.match[i] + 0.5f);
    if (!valid[nearest]) reasons[i] = static_cast<uint8_t>(reasons[i] | outside_overlap);
  }
}

void write_depth(const uint8_t* reasons, int count, const Scratch& s, float* depth) {
  for (int i = 0; i < count; ++i) depth[i] = reasons[i] == 0 ? s.depth[i] : __builtin_nanf("");
}

void write_sigma(const uint8_t* reasons, const float* confidence, int count, float factor, const Scratch& s,
                 float* sigma) {
  for (int i = 0; i < count; ++i) {
    float c = confidence[i];
    c = c > least_confidence ? c : least_confidence;
    c = c < most_confidence ? c : most_confidence;
    const float value = factor * s.depth[i] * s.depth[i] / negative_log1m(c);
    sigma[i] = reasons[i] == 0 ? value : __builtin_nanf("");
  }
}

int count_usable(const uint8_t* reasons, int count) {
  int usable = 0;
  for (int i = 0; i < count; ++i) usable += reasons[i] == 0 ? 1 : 0;
  return usable;
}

}  // namespace

void blend_rows(const float* upper, const float* lower, float weight, float gain, int count, float* value,
                float* step) {
  for (int i = 0; i < count; ++i) value[i] = gain * (upper[i] + weight * (lower[i] - upper[i]));
  for (int i = 0; i + 1 < count; ++i) step[i] = value[i + 1] - value[i];
  step[count - 1] = 0.0f;
}

int depth_row(const DepthRow& row, const DepthLimits& limits) {
  Scratch s;
  for (int i = chunk; i < 2 * chunk; ++i) s.cover[i] = infinity;
  const float last = static_cast<float>(row.width - 1);
  const bool right_has_holes =
      row.valid_right != nullptr && memchr(row.valid_right, 0, static_cast<size_t>(row.width)) != nullptr;
  float covered_from = infinity;
  int usable = 0;
  // From the right, because what covers a pixel lies to its right.
  for (int first = (row.width - 1) / chunk * chunk; first >= 0; first -= chunk) {
    const int count = row.width - first < chunk ? row.width - first : chunk;
    const float* disparity = row.disparity + first;
    const float* confidence = row.confidence + first;
    uint8_t* reasons = row.reasons + first;
    find_matches(disparity, first, count, s);
    give_reasons(confidence, count, last, covered_from, limits.min_confidence, s, reasons);
    if (limits.metric) {
      measure_depth(disparity, count, limits, s);
      add_range_reasons(disparity, count, limits, s, reasons);
    } else {
      add_sign_reasons(disparity, count, reasons);
    }
    if (row.brightness != nullptr) add_glare_reasons(row.brightness + first, count, reasons);
    if (row.valid_left != nullptr) add_left_reasons(row.valid_left + first, count, reasons);
    if (right_has_holes) add_right_reasons(row.valid_right, count, last, s, reasons);
    if (row.depth != nullptr) write_depth(reasons, count, s, row.depth + first);
    if (row.sigma != nullptr) write_sigma(reasons, confidence, count, limits.sigma_factor, s, row.sigma + first);
    usable += count_usable(reasons, count);
    covered_from = s.cover[0] < covered_from ? s.cover[0] : covered_from;
  }
  return usable;
}

}  // namespace endosdk::ENDOSDK_ISA
