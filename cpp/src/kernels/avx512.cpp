// Kernels for AVX-512 (F, BW, DQ, VL).
#include <immintrin.h>
#include <string.h>

#include "kernels.hpp"
#include "sets.hpp"

namespace endosdk::avx512 {
namespace {

constexpr int lanes = 16;

// The same 16 bytes in each quarter.
inline __m512i quarters(__m128i bytes) { return _mm512_broadcast_i32x4(bytes); }

inline __m256i everywhere(const uint8_t* from) {
  long long value;
  memcpy(&value, from, sizeof(value));
  return _mm256_set1_epi64x(value);
}

// 8 bytes from each of 4 or 8 places; broadcast loads rather than gathers, as in the AVX2 kernels.
inline __m256i collect4(const uint8_t* base, const int32_t* offset) {
  const __m256i low = _mm256_blend_epi32(everywhere(base + offset[0]), everywhere(base + offset[1]), 0x0c);
  const __m256i high = _mm256_blend_epi32(everywhere(base + offset[2]), everywhere(base + offset[3]), 0xc0);
  return _mm256_blend_epi32(low, high, 0xf0);
}

inline __m512i collect8(const uint8_t* base, const int32_t* offset) {
  return _mm512_inserti64x4(_mm512_castsi256_si512(collect4(base, offset)), collect4(base, offset + 4), 1);
}

// For each of 8 pixels one 64-bit lane that repeats `bytes` shifted to the pixel's place among 8 16-bit fractions.
inline __m512i per_pixel(long long bytes, long long step) {
  return _mm512_setr_epi64(bytes, bytes + step, bytes + 2 * step, bytes + 3 * step, bytes + 4 * step, bytes + 5 * step,
                           bytes + 6 * step, bytes + 7 * step);
}

// 8 pixels, each as 4 words (three channels and one unused), from 8 bytes of each row; see the AVX2 kernels.
inline __m512i blend8(__m512i upper, __m512i lower, const uint16_t* fraction) {
  const __m512i pairs = quarters(_mm_setr_epi8(0, 3, 1, 4, 2, 5, -1, -1, 8, 11, 9, 12, 10, 13, -1, -1));
  const __m512i all_x = per_pixel(0, 0x0202020202020202);
  const __m512i high_y = per_pixel(0x0180018001800180, 0x0200020002000200);
  const __m512i zero_level = _mm512_set1_epi8(-128);
  const __m512i f = quarters(_mm_loadu_si128(reinterpret_cast<const __m128i*>(fraction)));
  const __m512i fx = _mm512_xor_si512(_mm512_shuffle_epi8(f, all_x), _mm512_set1_epi16(0x00ff));
  const __m512i weights = _mm512_add_epi8(fx, _mm512_set1_epi16(0x0081));
  const __m512i u = _mm512_maddubs_epi16(weights, _mm512_xor_si512(_mm512_shuffle_epi8(upper, pairs), zero_level));
  const __m512i l = _mm512_maddubs_epi16(weights, _mm512_xor_si512(_mm512_shuffle_epi8(lower, pairs), zero_level));
  const __m512i fy_high = _mm512_shuffle_epi8(f, high_y);
  const __m512i value = _mm512_add_epi16(u, _mm512_mulhrs_epi16(_mm512_sub_epi16(l, u), fy_high));
  return _mm512_srai_epi16(_mm512_add_epi16(value, _mm512_set1_epi16(64)), 7);
}

inline void remap_rgb_16(const uint8_t* source, ptrdiff_t stride, __m512i stride_lanes, const uint32_t* corner,
                         const uint16_t* fraction, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  const __m512i c = _mm512_loadu_si512(corner);
  const __m512i x = _mm512_and_si512(c, _mm512_set1_epi32(0xffff));
  const __m512i y = _mm512_srli_epi32(c, 16);
  const __m512i three_x = _mm512_add_epi32(_mm512_add_epi32(x, x), x);
  alignas(64) int32_t offset[lanes];
  _mm512_store_si512(offset, _mm512_add_epi32(_mm512_mullo_epi32(y, stride_lanes), three_x));
  asm volatile("" : "+m"(offset));
  const uint8_t* below = source + stride;
  const __m512i first = blend8(collect8(source, offset), collect8(below, offset), fraction);
  const __m512i second = blend8(collect8(source, offset + 8), collect8(below, offset + 8), fraction + 8);
  // Packing works within quarters: put the pixels back in order, group the channels, then bring each channel together.
  const __m512i packed = _mm512_xor_si512(_mm512_packs_epi16(first, second), _mm512_set1_epi8(-128));
  const __m512i order = _mm512_setr_epi32(0, 1, 4, 5, 8, 9, 12, 13, 2, 3, 6, 7, 10, 11, 14, 15);
  const __m512i by_channel = quarters(_mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15));
  const __m512i grouped = _mm512_shuffle_epi8(_mm512_permutexvar_epi32(order, packed), by_channel);
  const __m512i together = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
  const __m512i planes = _mm512_permutexvar_epi32(together, grouped);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(c0), _mm512_castsi512_si128(planes));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(c1), _mm512_extracti32x4_epi32(planes, 1));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(c2), _mm512_extracti32x4_epi32(planes, 2));
}

}  // namespace

void remap_rgb(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  if (span.count < lanes) return avx2::remap_rgb(source, stride, span, c0, c1, c2);
  const __m512i stride_lanes = _mm512_set1_epi32(static_cast<int>(stride));
  for (int i = 0; i < span.count; i += lanes) {
    const int at = i + lanes <= span.count ? i : span.count - lanes;  // the last group may overlap the one before
    remap_rgb_16(source, stride, stride_lanes, span.corner + at, span.fraction + at, c0 + at, c1 + at, c2 + at);
  }
}

void stretch_row(const float* value, const float* step, const int32_t* index, const float* weight, int count,
                 float* out) {
  int x = 0;
  for (; x + lanes <= count; x += lanes) {
    const int first = index[x];
    if (index[x + lanes - 1] - first >= lanes) break;  // the map shrinks: neighbours are too far apart for a permutation
    const __m512i at = _mm512_sub_epi32(_mm512_loadu_si512(index + x), _mm512_set1_epi32(first));
    const __m512 v = _mm512_permutexvar_ps(at, _mm512_loadu_ps(value + first));
    const __m512 s = _mm512_permutexvar_ps(at, _mm512_loadu_ps(step + first));
    _mm512_storeu_ps(out + x, _mm512_add_ps(v, _mm512_mul_ps(_mm512_loadu_ps(weight + x), s)));
  }
  avx2::stretch_row(value, step, index + x, weight + x, count - x, out + x);
}

// Wider registers gain nothing for the kernels that wait for memory.
void remap_gray(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out) {
  avx2::remap_gray(source, stride, span, out);
}

void split_rgb(const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  avx2::split_rgb(source, count, c0, c1, c2);
}

}  // namespace endosdk::avx512
