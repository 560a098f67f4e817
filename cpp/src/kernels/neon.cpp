// Kernels for NEON, which every 64-bit ARM processor has.
#include <arm_neon.h>
#include <string.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::neon {
namespace {

constexpr int lanes = 8;

// The low half holds the bytes from the upper left neighbour on, the high half the bytes below them.
inline uint8x16_t both_rows(const uint8_t* upper, ptrdiff_t stride) {
  return vcombine_u8(vld1_u8(upper), vld1_u8(upper + stride));
}

inline uint16x8_t words(uint8x16_t bytes) { return vreinterpretq_u16_u8(bytes); }
inline uint32x4_t wide(uint16x8_t values) { return vreinterpretq_u32_u16(values); }
inline uint8x16_t narrow(uint32x4_t values) { return vreinterpretq_u8_u32(values); }

// Transposes 8 bytes in both rows of 8 pixels. `byte[i]` gets the i-th byte of all pixels; the first 6 bytes are the left and
// right neighbours of each channel.
inline void transpose(const uint8x16_t (&pixel)[lanes], uint8x16_t (&byte)[6]) {
  uint16x8_t pairs[lanes];
  for (int i = 0; i < lanes; i += 2) {
    pairs[i] = words(vtrn1q_u8(pixel[i], pixel[i + 1]));
    pairs[i + 1] = words(vtrn2q_u8(pixel[i], pixel[i + 1]));
  }
  uint32x4_t fours[lanes];
  for (int i = 0; i < lanes; i += 4) {
    for (int k = 0; k < 2; ++k) {
      fours[i + k] = wide(vtrn1q_u16(pairs[i + k], pairs[i + k + 2]));
      fours[i + k + 2] = wide(vtrn2q_u16(pairs[i + k], pairs[i + k + 2]));
    }
  }
  for (int k = 0; k < 4; ++k) byte[k] = narrow(vtrn1q_u32(fours[k], fours[k + 4]));
  for (int k = 0; k < 2; ++k) byte[k + 4] = narrow(vtrn2q_u32(fours[k], fours[k + 4]));
}

// Interpolates along a row, between left and right neighbours, in 1/128 grey levels centred on zero. Intermediate sums may wrap
// around, but the result fits.
inline int16x8_t along_row(uint8x8_t left, uint8x8_t right, int16x8_t fx) {
  const int8x8_t centred = vreinterpret_s8_u8(veor_u8(left, vdup_n_u8(0x80)));
  return vmlaq_s16(vshll_n_s8(centred, 7), vreinterpretq_s16_u16(vsubl_u8(right, left)), fx);
}

// Interpolates one channel of 8 pixels. `fy_high` is the fraction times 256.
inline void blend(uint8x16_t left, uint8x16_t right, int16x8_t fx, int16x8_t fy_high, uint8_t* out) {
  const int16x8_t upper = along_row(vget_low_u8(left), vget_low_u8(right), fx);
  const int16x8_t lower = along_row(vget_high_u8(left), vget_high_u8(right), fx);
  const int16x8_t value = vaddq_s16(upper, vqrdmulhq_s16(vsubq_s16(lower, upper), fy_high));
  vst1_u8(out, veor_u8(vreinterpret_u8_s8(vrshrn_n_s16(value, 7)), vdup_n_u8(0x80)));
}

struct Fractions {
  explicit Fractions(const uint16_t* fraction) {
    const uint16x8_t both = vld1q_u16(fraction);
    x = vreinterpretq_s16_u16(vandq_u16(both, vdupq_n_u16(0x00ff)));
    y_high = vreinterpretq_s16_u16(vandq_u16(both, vdupq_n_u16(0xff00)));
  }

  int16x8_t x;
  int16x8_t y_high;
};

inline const uint8_t* at_corner(const uint8_t* source, ptrdiff_t stride, uint32_t corner, int channels) {
  return source + static_cast<ptrdiff_t>(corner >> 16) * stride + static_cast<ptrdiff_t>(corner & 0xffff) * channels;
}

inline uint16x8_t pairs_of(const uint8_t* const (&corner)[lanes], ptrdiff_t offset) {
  uint16_t pairs[lanes];
  for (int i = 0; i < lanes; ++i) memcpy(&pairs[i], corner[i] + offset, sizeof pairs[i]);
  return vld1q_u16(pairs);
}

// Elements `index` (below 8) of the 8 floats from `values` on.
inline float32x4_t pick(const float* values, uint32x4_t index) {
  const uint8x16x2_t table = {{vreinterpretq_u8_f32(vld1q_f32(values)), vreinterpretq_u8_f32(vld1q_f32(values + 4))}};
  const uint32x4_t bytes = vmlaq_u32(vdupq_n_u32(0x03020100), index, vdupq_n_u32(0x04040404));
  return vreinterpretq_f32_u8(vqtbl2q_u8(table, vreinterpretq_u8_u32(bytes)));
}

}  // namespace

void remap_rgb(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  if (span.count < lanes) return plain::remap_rgb(source, stride, span, c0, c1, c2);
  for (int i = 0; i < span.count; i += lanes) {
    const int at = i + lanes <= span.count ? i : span.count - lanes;  // the last group may overlap the one before
    uint8x16_t pixel[lanes];
    for (int k = 0; k < lanes; ++k) pixel[k] = both_rows(at_corner(source, stride, span.corner[at + k], 3), stride);
    uint8x16_t byte[6];
    transpose(pixel, byte);
    const Fractions f(span.fraction + at);
    blend(byte[0], byte[3], f.x, f.y_high, c0 + at);
    blend(byte[1], byte[4], f.x, f.y_high, c1 + at);
    blend(byte[2], byte[5], f.x, f.y_high, c2 + at);
  }
}

void remap_gray(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out) {
  if (span.count < lanes) return plain::remap_gray(source, stride, span, out);
  for (int i = 0; i < span.count; i += lanes) {
    const int at = i + lanes <= span.count ? i : span.count - lanes;
    const uint8_t* corner[lanes];
    for (int k = 0; k < lanes; ++k) corner[k] = at_corner(source, stride, span.corner[at + k], 1);
    const uint8x16_t upper = vreinterpretq_u8_u16(pairs_of(corner, 0));
    const uint8x16_t lower = vreinterpretq_u8_u16(pairs_of(corner, stride));
    const Fractions f(span.fraction + at);
    blend(vuzp1q_u8(upper, lower), vuzp2q_u8(upper, lower), f.x, f.y_high, out + at);
  }
}

void split_rgb(const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  constexpr int group = 16;
  if (count < group) return plain::split_rgb(source, count, c0, c1, c2);
  for (int i = 0; i < count; i += group) {
    const int at = i + group <= count ? i : count - group;
    const uint8x16x3_t pixels = vld3q_u8(source + 3 * at);
    vst1q_u8(c0 + at, pixels.val[0]);
    vst1q_u8(c1 + at, pixels.val[1]);
    vst1q_u8(c2 + at, pixels.val[2]);
  }
}

void stretch_row(const float* value, const float* step, const int32_t* index, const float* weight, int count,
                 float* out) {
  constexpr int group = 4;
  int x = 0;
  for (; x + group <= count; x += group) {
    const int first = index[x];
    if (index[x + group - 1] - first >= 2 * group) break;  // the map shrinks: neighbours are too far apart for a table
    const uint32x4_t at = vreinterpretq_u32_s32(vsubq_s32(vld1q_s32(index + x), vdupq_n_s32(first)));
    const float32x4_t rise = vmulq_f32(vld1q_f32(weight + x), pick(step + first, at));
    vst1q_f32(out + x, vaddq_f32(pick(value + first, at), rise));
  }
  plain::stretch_row(value, step, index + x, weight + x, count - x, out + x);
}

}  // namespace endosdk::neon
