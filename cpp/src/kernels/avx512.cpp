// Kernels for AVX-512 (F, BW, DQ, VL).
#include <immintrin.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::avx512 {
namespace {

constexpr int lanes = 16;
constexpr int chunk = 128;  // pixels whose offsets are computed before they are used

// The same 16 bytes in each quarter.
inline __m512i quarters(__m128i bytes) { return _mm512_broadcast_i32x4(bytes); }

inline __m128i load16(const uint8_t* from) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from)); }

// Byte offsets of the upper left neighbours of 16 pixels.
inline void find_offsets(const uint32_t* corner, __m512i stride, int32_t* offset) {
  const __m512i corners = _mm512_loadu_si512(corner);
  const __m512i x = _mm512_and_si512(corners, _mm512_set1_epi32(0xffff));
  const __m512i y = _mm512_srli_epi32(corners, 16);
  const __m512i three_x = _mm512_add_epi32(_mm512_add_epi32(x, x), x);
  _mm512_storeu_si512(offset, _mm512_add_epi32(_mm512_mullo_epi32(y, stride), three_x));
}

// Collects 16 bytes from each of 4 places: pixels 0, 4, 8 and 12 from `offset` on.
inline __m512i collect4(const uint8_t* base, const int32_t* offset) {
  const __m256i low = _mm256_inserti128_si256(_mm256_castsi128_si256(load16(base + offset[0])),
                                              load16(base + offset[4]), 1);
  const __m256i high = _mm256_inserti128_si256(_mm256_castsi128_si256(load16(base + offset[8])),
                                               load16(base + offset[12]), 1);
  return _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
}

// Interpolates 8 pixels, two in each quarter, each as 4 words (three channels and one unused). Two pixels share 16 bytes; see
// the AVX2 kernels.
inline __m512i blend8(__m512i upper, __m512i lower, __m512i shift, __m512i fractions, __m128i all_x, __m128i high_y) {
  const __m512i first = quarters(_mm_setr_epi8(0, 3, 1, 4, 2, 5, -1, -1, 0, 3, 1, 4, 2, 5, -1, -1));
  const __m512i pairs = _mm512_add_epi8(first, shift);
  const __m512i zero_level = _mm512_set1_epi8(-128);
  const __m512i fx = _mm512_xor_si512(_mm512_shuffle_epi8(fractions, quarters(all_x)), _mm512_set1_epi16(0x00ff));
  const __m512i weights = _mm512_add_epi8(fx, _mm512_set1_epi16(0x0081));
  const __m512i u = _mm512_maddubs_epi16(weights, _mm512_xor_si512(_mm512_shuffle_epi8(upper, pairs), zero_level));
  const __m512i l = _mm512_maddubs_epi16(weights, _mm512_xor_si512(_mm512_shuffle_epi8(lower, pairs), zero_level));
  const __m512i fy_high = _mm512_shuffle_epi8(fractions, quarters(high_y));
  const __m512i value = _mm512_add_epi16(u, _mm512_mulhrs_epi16(_mm512_sub_epi16(l, u), fy_high));
  return _mm512_srai_epi16(_mm512_add_epi16(value, _mm512_set1_epi16(64)), 7);
}

// Remaps 16 pixels. Returns false and writes nothing if the two pixels of a pair lie in different rows or too far apart.
inline bool remap_rgb_16(const uint8_t* source, ptrdiff_t stride, const uint32_t* corner, const uint16_t* fraction,
                         const int32_t* offset, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  const __m512i corners = _mm512_loadu_si512(corner);
  const __m512i distance = _mm512_sub_epi32(_mm512_srli_epi64(corners, 32), corners);
  if (_mm512_test_epi64_mask(distance, _mm512_set1_epi64(0xfffffffc)) != 0) return false;
  const uint8_t* below = source + stride;
  const __m512i bytes = _mm512_add_epi32(_mm512_add_epi32(distance, distance), distance);
  const __m128i from_first = _mm_setr_epi8(-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0);
  const __m128i from_second = _mm_setr_epi8(-1, -1, -1, -1, -1, -1, -1, -1, 8, 8, 8, 8, 8, 8, 8, 8);
  // The 4 fractions of each quarter's pixels, twice.
  const __m256i fraction_16 = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(fraction));
  const __m512i f = _mm512_permutexvar_epi64(_mm512_setr_epi64(0, 0, 1, 1, 2, 2, 3, 3),
                                             _mm512_castsi256_si512(fraction_16));
  const __m512i front = blend8(collect4(source, offset), collect4(below, offset),
                               _mm512_shuffle_epi8(bytes, quarters(from_first)), f,
                               _mm_setr_epi8(0, 0, 0, 0, 0, 0, 0, 0, 2, 2, 2, 2, 2, 2, 2, 2),
                               _mm_setr_epi8(-1, 1, -1, 1, -1, 1, -1, 1, -1, 3, -1, 3, -1, 3, -1, 3));
  const __m512i back = blend8(collect4(source, offset + 2), collect4(below, offset + 2),
                              _mm512_shuffle_epi8(bytes, quarters(from_second)), f,
                              _mm_setr_epi8(4, 4, 4, 4, 4, 4, 4, 4, 6, 6, 6, 6, 6, 6, 6, 6),
                              _mm_setr_epi8(-1, 5, -1, 5, -1, 5, -1, 5, -1, 7, -1, 7, -1, 7, -1, 7));
  const __m512i pixels = _mm512_xor_si512(_mm512_packs_epi16(front, back), _mm512_set1_epi8(-128));
  // The pixels are in order, with 4 bytes each. Group the channels within the quarters, then join each channel.
  const __m512i by_channel = quarters(_mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15));
  const __m512i grouped = _mm512_shuffle_epi8(pixels, by_channel);
  const __m512i channels = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
  const __m512i planes = _mm512_permutexvar_epi32(channels, grouped);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(c0), _mm512_castsi512_si128(planes));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(c1), _mm512_extracti32x4_epi32(planes, 1));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(c2), _mm512_extracti32x4_epi32(planes, 2));
  return true;
}

}  // namespace

void remap_rgb(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  if (span.count < lanes) return avx2::remap_rgb(source, stride, span, c0, c1, c2);
  const __m512i stride_lanes = _mm512_set1_epi32(static_cast<int>(stride));
  int32_t offset[chunk];
  for (int first = 0; first < span.count; first += chunk) {
    const int begin = first + lanes <= span.count ? first : span.count - lanes;
    const int count = span.count - begin < chunk ? span.count - begin : chunk;
    for (int i = 0; i < count; i += lanes) {
      const int at = i + lanes <= count ? i : count - lanes;  // the last group may overlap the one before
      find_offsets(span.corner + begin + at, stride_lanes, offset + at);
    }
    for (int i = 0; i < count; i += lanes) {
      const int in = i + lanes <= count ? i : count - lanes;
      const int at = begin + in;
      const RemapSpan group = {span.corner + at, span.fraction + at, lanes};
      if (!remap_rgb_16(source, stride, group.corner, group.fraction, offset + in, c0 + at, c1 + at, c2 + at)) {
        avx2::remap_rgb(source, stride, group, c0 + at, c1 + at, c2 + at);
      }
    }
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

// Wider registers do not speed up the kernels that wait for memory, so these use the AVX2 versions.
void remap_gray(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out) {
  avx2::remap_gray(source, stride, span, out);
}

void split_rgb(const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  avx2::split_rgb(source, count, c0, c1, c2);
}

}  // namespace endosdk::avx512
