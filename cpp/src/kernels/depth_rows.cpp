// Depth, reasons and blending of rows. The file is compiled once per instruction set: plain loops that the compiler vectorises.
// In the whole build, the compiler may neither contract to fused multiply-add nor reassociate, so that every set rounds alike.
#include <string.h>

#include "maps/reasons.hpp"
#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"
#include "kernels/sharpness.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

constexpr int chunk = 256;
constexpr int lead = 2 * chunk;  // pixels by which memory is prefetched
constexpr float infinity = __builtin_inff();

// Scratch memory of one chunk of a row. The second half of `cover` stays infinite, because the scan reads it.
struct Scratch {
  float match[chunk];      // column of the match in the right view; infinity where the disparity is not finite
  float cover[2 * chunk];  // leftmost match of this pixel and the pixels on its right
  int32_t reasons[chunk];  // 32 bits wide, as the floats from which they are computed
  float unwanted[chunk];   // depth, if the caller did not ask for it
};

// Columns in which a match must lie to be visible: the valid columns and half a pixel around them.
struct Overlap {
  float last;   // column of the right view
  float begin;  // for match + 0.5
  float end;
};

float match_of(float disparity, int column) {
  return __builtin_fabsf(disparity) < infinity ? static_cast<float>(column) - disparity : infinity;
}

// Computes the matches. Returns true if no match lies left of the match before, as on every smooth surface.
bool find_matches(const float* disparity, int first, int count, float* match) {
  int rise = 1;
  // Each match is computed twice: reading it back from `match` right after writing would stall.
  for (int i = 0; i + 1 < count; ++i) {
    match[i] = match_of(disparity[i], first + i);
    rise &= match_of(disparity[i + 1], first + i + 1) >= match[i];
  }
  match[count - 1] = match_of(disparity[count - 1], first + count - 1);
  for (int i = count; i < chunk; ++i) match[i] = infinity;
  return rise != 0;
}

// For each pixel, finds the leftmost match of this pixel and the pixels on its right.
const float* find_cover(Scratch& s) {
  memcpy(s.cover, s.match, chunk * sizeof(float));
  // Each pass doubles the range over which a minimum is taken.
  for (int reach = 1; reach < chunk; reach *= 2) {
    for (int i = 0; i < chunk; ++i) {
      const float ahead = s.cover[i + reach];
      s.cover[i] = ahead < s.cover[i] ? ahead : s.cover[i];
    }
  }
  return s.cover;
}

// The conditions below are combined with & and |, not && and ||, because only a loop without branches can be vectorised.

// `covered_from` is the leftmost match of all chunks on the right.
void give_reasons(const float* disparity, const float* confidence, int count, const float* match, const float* cover,
                  float covered_from, const Overlap overlap, const DepthLimits limits, int32_t* __restrict reasons) {
  for (int i = 0; i < count; ++i) {
    const float m = match[i];
    const float leftmost = cover[i] < covered_from ? cover[i] : covered_from;
    const float nearest = m + 0.5f;
    const int finite = m < infinity;
    const int seen = (m >= 0.0f) & (m <= overlap.last) & (nearest >= overlap.begin) & (nearest < overlap.end);
    const int found = finite & (disparity[i] > limits.disparity_begin) & (disparity[i] < limits.disparity_end);
    int r = confidence[i] >= limits.min_confidence ? 0 : ENDO_REASON_LOW_CONFIDENCE;
    r |= (finite & (leftmost < m - 1.0f)) ? ENDO_REASON_OCCLUDED : 0;
    r |= (finite & (seen ^ 1)) ? ENDO_REASON_OUTSIDE_OVERLAP : 0;
    r |= found ? 0 : ENDO_REASON_OUT_OF_RANGE;
    reasons[i] = r;
  }
}

void add_glare_reasons(const uint8_t* brightness, int count, int32_t* reasons) {
  for (int i = 0; i < count; ++i) reasons[i] |= brightness[i] >= saturation_level ? ENDO_REASON_SATURATED : 0;
}

void add_field_reasons(const uint8_t* inside, int count, int32_t* reasons) {
  for (int i = 0; i < count; ++i) reasons[i] |= inside[i] ? 0 : ENDO_REASON_OUTSIDE_VIEW;
}

void add_left_reasons(const uint8_t* valid, int count, int32_t* reasons) {
  for (int i = 0; i < count; ++i) reasons[i] |= valid[i] ? 0 : ENDO_REASON_OUTSIDE_OVERLAP;
}

// Adds reasons for right views whose valid part has holes.
void add_right_reasons(const uint8_t* valid, int count, float last, Scratch& s) {
  for (int i = 0; i < count; ++i) {
    if (!(s.match[i] >= 0.0f && s.match[i] <= last)) continue;
    if (!valid[static_cast<int>(s.match[i] + 0.5f)]) s.reasons[i] |= ENDO_REASON_OUTSIDE_OVERLAP;
  }
}

void write_depth(const float* disparity, int count, const DepthLimits limits, int32_t* __restrict reasons,
                 float* __restrict depth) {
  for (int i = 0; i < count; ++i) {
    const float value = limits.focal_baseline / (disparity[i] + limits.doffs);
    const int number = (value > 0.0f) & (value < infinity);
    const int usable = number & (value >= limits.min_depth) & (value <= limits.max_depth);
    const int r = reasons[i] | (usable ? 0 : ENDO_REASON_OUT_OF_RANGE);
    reasons[i] = r;
    depth[i] = r == 0 ? value : __builtin_nanf("");
  }
}

void write_sigma(const int32_t* reasons, const float* confidence, const float* depth, int count, float factor,
                 float* __restrict sigma) {
  for (int i = 0; i < count; ++i) {
    const float value = factor * depth[i] * depth[i] / sharpness(confidence[i]);
    sigma[i] = reasons[i] == 0 ? value : __builtin_nanf("");
  }
}

// Writes the reasons. Returns the number of pixels without a reason.
int write_reasons(const int32_t* __restrict reasons, int count, uint8_t* __restrict out) {
  int usable = 0;
  for (int i = 0; i < count; ++i) {
    usable += reasons[i] == 0 ? 1 : 0;
    out[i] = static_cast<uint8_t>(reasons[i]);
  }
  return usable;
}

// The columns of the valid pixels of a row, if these lie side by side. Otherwise the whole row, and `holes` becomes true.
Overlap overlap_of(const DepthRow& row, bool& holes) {
  const float width = static_cast<float>(row.width);
  const Overlap whole = {width - 1.0f, 0.0f, width};
  holes = false;
  if (row.valid_right == nullptr) return whole;
  const uint8_t* begin = row.valid_right;
  const uint8_t* end = begin + row.width;
  while (begin != end && *begin == 0) ++begin;
  while (end != begin && end[-1] == 0) --end;
  holes = begin != end && memchr(begin, 0, static_cast<size_t>(end - begin)) != nullptr;
  if (holes) return whole;
  return {width - 1.0f, static_cast<float>(begin - row.valid_right), static_cast<float>(end - row.valid_right)};
}

// Prefetches the memory of a later chunk: the hardware does not predict that rows are written backwards, chunk by chunk. The
// function is always inline, because GCC removes calls of functions that only prefetch.
[[gnu::always_inline]] inline void fetch(const DepthRow& row, int first) {
  constexpr int line = 64;  // bytes
  constexpr int floats = line / static_cast<int>(sizeof(float));
  for (int i = 0; i < chunk; i += floats) {
    if (row.depth != nullptr) __builtin_prefetch(row.depth + first + i, 1);
    if (row.sigma != nullptr) __builtin_prefetch(row.sigma + first + i, 1);
  }
  for (int i = 0; i < chunk; i += line) {
    __builtin_prefetch(row.reasons + first + i, 1);
    if (row.valid_left != nullptr) __builtin_prefetch(row.valid_left + first + i);
  }
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
  bool right_has_holes;
  const Overlap overlap = overlap_of(row, right_has_holes);
  float covered_from = infinity;
  int usable = 0;
  // Goes from right to left, because the pixels that cover a pixel lie on its right.
  for (int first = (row.width - 1) / chunk * chunk; first >= 0; first -= chunk) {
    const int count = row.width - first < chunk ? row.width - first : chunk;
    const float* disparity = row.disparity + first;
    const float* confidence = row.confidence + first;
    if (first >= lead) fetch(row, first - lead);
    const bool rise = find_matches(disparity, first, count, s.match);
    const float* cover = rise ? s.match : find_cover(s);
    give_reasons(disparity, confidence, count, s.match, cover, covered_from, overlap, limits, s.reasons);
    if (row.brightness != nullptr) add_glare_reasons(row.brightness + first, count, s.reasons);
    if (row.inside_left != nullptr) add_field_reasons(row.inside_left + first, count, s.reasons);
    if (row.valid_left != nullptr) add_left_reasons(row.valid_left + first, count, s.reasons);
    if (right_has_holes) add_right_reasons(row.valid_right, count, overlap.last, s);
    if (limits.metric) {
      float* const depth = row.depth != nullptr ? row.depth + first : s.unwanted;
      write_depth(disparity, count, limits, s.reasons, depth);
      if (row.sigma != nullptr) {
        write_sigma(s.reasons, row.own_confidence + first, depth, count, limits.sigma_factor, row.sigma + first);
      }
    }
    usable += write_reasons(s.reasons, count, row.reasons + first);
    covered_from = cover[0] < covered_from ? cover[0] : covered_from;
  }
  return usable;
}

void add_rig_sigma(const RigSigmaRow& row) {
  const float start = row.start;
  const float step = row.step;
  const float constant = row.constant;
  const float per_square = row.per_square;
  const float per_fourth = row.per_fourth;
  float* __restrict const sigma = row.sigma;
  for (int x = 0; x < row.width; ++x) {
    const float u = start + step * static_cast<float>(x);
    const float square = u * u;
    const float whole = 1.0f + square;
    const float depth = row.depth[x] * row.depth[x];
    const float adds = constant + per_square * square + per_fourth * (whole * whole);
    sigma[x] = __builtin_sqrtf(sigma[x] * sigma[x] + depth * depth * adds);
  }
}

}  // namespace endosdk::ENDOSDK_ISA
