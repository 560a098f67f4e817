// Kernels for AVX2.
#include <immintrin.h>
#include <string.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::avx2 {
namespace {

constexpr int lanes = 8;
constexpr int chunk = 128;  // pixels whose offsets are computed before they are used

// Byte offsets of the upper left neighbours of 8 pixels.
inline void find_offsets(const uint32_t* corner, __m256i stride, int channels, int32_t* offset) {
  const __m256i corners = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(corner));
  const __m256i x = _mm256_and_si256(corners, _mm256_set1_epi32(0xffff));
  const __m256i y = _mm256_srli_epi32(corners, 16);
  const __m256i sum =
      _mm256_add_epi32(_mm256_mullo_epi32(y, stride), _mm256_mullo_epi32(x, _mm256_set1_epi32(channels)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(offset), sum);
}

inline __m256i everywhere64(const uint8_t* from) {
  long long value;
  memcpy(&value, from, sizeof(value));
  return _mm256_set1_epi64x(value);
}

inline __m256i everywhere32(const uint8_t* from) {
  int value;
  memcpy(&value, from, sizeof(value));
  return _mm256_set1_epi32(value);
}

// Collects 4 bytes from each of 8 places.
inline __m256i collect8(const uint8_t* base, const int32_t* offset) {
  const __m256i a = _mm256_blend_epi32(everywhere32(base + offset[0]), everywhere32(base + offset[1]), 0x02);
  const __m256i b = _mm256_blend_epi32(everywhere32(base + offset[2]), everywhere32(base + offset[3]), 0x08);
  const __m256i c = _mm256_blend_epi32(everywhere32(base + offset[4]), everywhere32(base + offset[5]), 0x20);
  const __m256i d = _mm256_blend_epi32(everywhere32(base + offset[6]), everywhere32(base + offset[7]), 0x80);
  return _mm256_blend_epi32(_mm256_blend_epi32(a, b, 0x0c), _mm256_blend_epi32(c, d, 0xc0), 0xf0);
}

// Turns the fractions fx of all bytes into pairs (128 - fx, fx): even bytes become (fx ^ 255) + 129.
inline __m256i pair_weights(__m256i fx) {
  const __m256i even = _mm256_set1_epi16(0x00ff);
  return _mm256_add_epi8(_mm256_xor_si256(fx, even), _mm256_set1_epi16(0x0081));
}

// Interpolates between two rows in 1/128 grey levels, and rounds to whole grey levels, centred on zero.
inline __m256i between_rows(__m256i upper, __m256i lower, __m256i fy_high) {
  const __m256i value = _mm256_add_epi16(upper, _mm256_mulhrs_epi16(_mm256_sub_epi16(lower, upper), fy_high));
  return _mm256_srai_epi16(_mm256_add_epi16(value, _mm256_set1_epi16(64)), 7);
}

// The same 16 bytes in each half.
inline __m256i halves(__m128i bytes) { return _mm256_broadcastsi128_si256(bytes); }

inline __m128i load16(const uint8_t* from) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from)); }

// The bytes around 4 pixels, two pixels in each half. `pairs` tells where in its half the neighbours of each pixel are: left
// and right neighbour of each channel, side by side.
struct Quad {
  __m256i upper;
  __m256i lower;
  __m256i pairs;
};

// A quad takes pixels 0, 1, 4, 5 from `offset` on, so that packing two quads gives 8 pixels in order.
//
// Here each pixel has 8 bytes of its own. Broadcast loads and blends are used because gather instructions are slow on many
// processors: the microcode that closes their data leak makes them several times slower than this.
inline __m256i collect4(const uint8_t* base, const int32_t* offset) {
  const __m256i low = _mm256_blend_epi32(everywhere64(base + offset[0]), everywhere64(base + offset[1]), 0x0c);
  const __m256i high = _mm256_blend_epi32(everywhere64(base + offset[4]), everywhere64(base + offset[5]), 0xc0);
  return _mm256_blend_epi32(low, high, 0xf0);
}

inline Quad apart(const uint8_t* source, ptrdiff_t stride, const int32_t* offset) {
  return {collect4(source, offset), collect4(source + stride, offset),
          halves(_mm_setr_epi8(0, 3, 1, 4, 2, 5, -1, -1, 8, 11, 9, 12, 10, 13, -1, -1))};
}

// Here two pixels share 16 bytes. `shift` holds their distance in bytes, at the places of the second pixel.
inline __m256i collect2(const uint8_t* base, const int32_t* offset) {
  return _mm256_inserti128_si256(_mm256_castsi128_si256(load16(base + offset[0])), load16(base + offset[4]), 1);
}

inline Quad together(const uint8_t* source, ptrdiff_t stride, const int32_t* offset, __m256i shift) {
  const __m256i first = halves(_mm_setr_epi8(0, 3, 1, 4, 2, 5, -1, -1, 0, 3, 1, 4, 2, 5, -1, -1));
  return {collect2(source, offset), collect2(source + stride, offset), _mm256_add_epi8(first, shift)};
}

// Interpolates 4 pixels, each as 4 words: three channels and one unused. `all_x` and `high_y` select each pixel's fractions
// from `fractions`: fx for all bytes of a pixel, fy for the upper byte of its words.
inline __m256i blend4(const Quad& quad, __m256i fractions, __m256i all_x, __m256i high_y) {
  const __m256i zero_level = _mm256_set1_epi8(-128);
  const __m256i weights = pair_weights(_mm256_shuffle_epi8(fractions, all_x));
  const __m256i u = _mm256_xor_si256(_mm256_shuffle_epi8(quad.upper, quad.pairs), zero_level);
  const __m256i l = _mm256_xor_si256(_mm256_shuffle_epi8(quad.lower, quad.pairs), zero_level);
  return between_rows(_mm256_maddubs_epi16(weights, u), _mm256_maddubs_epi16(weights, l),
                      _mm256_shuffle_epi8(fractions, high_y));
}

inline void remap_rgb_8(const uint8_t* source, ptrdiff_t stride, const uint32_t* corner, const uint16_t* fraction,
                        const int32_t* offset, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  const __m256i corners = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(corner));
  // Usually the two pixels of a pair lie in one row, at most 3 apart. Then one load is enough for both.
  const __m256i distance = _mm256_sub_epi32(_mm256_srli_epi64(corners, 32), corners);
  Quad front, back;
  if (_mm256_testz_si256(distance, _mm256_set1_epi64x(0xfffffffc))) {
    const __m256i bytes = _mm256_add_epi32(_mm256_add_epi32(distance, distance), distance);
    const __m128i from_first = _mm_setr_epi8(-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0);
    const __m128i from_second = _mm_setr_epi8(-1, -1, -1, -1, -1, -1, -1, -1, 8, 8, 8, 8, 8, 8, 8, 8);
    front = together(source, stride, offset, _mm256_shuffle_epi8(bytes, halves(from_first)));
    back = together(source, stride, offset + 2, _mm256_shuffle_epi8(bytes, halves(from_second)));
  } else {
    front = apart(source, stride, offset);
    back = apart(source, stride, offset + 2);
  }
  const __m256i f = halves(load16(reinterpret_cast<const uint8_t*>(fraction)));
  const __m256i front_x = _mm256_setr_epi8(0, 0, 0, 0, 0, 0, 0, 0, 2, 2, 2, 2, 2, 2, 2, 2,  //
                                           8, 8, 8, 8, 8, 8, 8, 8, 10, 10, 10, 10, 10, 10, 10, 10);
  const __m256i front_y = _mm256_setr_epi8(-1, 1, -1, 1, -1, 1, -1, 1, -1, 3, -1, 3, -1, 3, -1, 3,  //
                                           -1, 9, -1, 9, -1, 9, -1, 9, -1, 11, -1, 11, -1, 11, -1, 11);
  const __m256i back_x = _mm256_add_epi8(front_x, _mm256_set1_epi8(4));
  const __m256i back_y = _mm256_add_epi8(front_y, _mm256_set1_epi16(0x0400));
  const __m256i words_front = blend4(front, f, front_x, front_y);
  const __m256i words_back = blend4(back, f, back_x, back_y);
  const __m256i pixels = _mm256_xor_si256(_mm256_packs_epi16(words_front, words_back), _mm256_set1_epi8(-128));
  // The pixels are in order, with 4 bytes each. Group the channels within the halves, then join each channel.
  const __m256i by_channel = halves(_mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15));
  const __m256i grouped = _mm256_shuffle_epi8(pixels, by_channel);
  const __m256i planes = _mm256_permutevar8x32_epi32(grouped, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7));
  const __m128i low = _mm256_castsi256_si128(planes);
  _mm_storel_epi64(reinterpret_cast<__m128i*>(c0), low);
  _mm_storel_epi64(reinterpret_cast<__m128i*>(c1), _mm_srli_si128(low, 8));
  _mm_storel_epi64(reinterpret_cast<__m128i*>(c2), _mm256_extracti128_si256(planes, 1));
}

inline void remap_gray_8(const uint8_t* source, ptrdiff_t stride, const uint16_t* fraction, const int32_t* offset,
                         uint8_t* out) {
  const __m256i upper = collect8(source, offset);
  const __m256i lower = collect8(source + stride, offset);
  // One 32-bit lane per pixel: two upper neighbours, then two lower ones.
  const __m256i four = _mm256_blend_epi16(upper, _mm256_slli_epi32(lower, 16), 0xaa);
  const __m256i f =
      _mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(fraction)));
  const __m256i all_x = _mm256_setr_epi8(0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12,  //
                                         0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12);
  const __m256i rows = _mm256_maddubs_epi16(pair_weights(_mm256_shuffle_epi8(f, all_x)),
                                            _mm256_xor_si256(four, _mm256_set1_epi8(-128)));
  const __m256i fy_high = _mm256_and_si256(f, _mm256_set1_epi32(0xff00));
  const __m256i value = between_rows(rows, _mm256_srli_epi32(rows, 16), fy_high);
  // Only the low word of each lane holds a pixel.
  const __m256i signed_value = _mm256_srai_epi32(_mm256_slli_epi32(value, 16), 16);
  const __m256i words = _mm256_packs_epi32(signed_value, signed_value);
  const __m256i bytes = _mm256_xor_si256(_mm256_packs_epi16(words, words), _mm256_set1_epi8(-128));
  const __m256i joined = _mm256_permutevar8x32_epi32(bytes, _mm256_setr_epi32(0, 4, 0, 4, 0, 4, 0, 4));
  _mm_storel_epi64(reinterpret_cast<__m128i*>(out), _mm256_castsi256_si128(joined));
}

}  // namespace

void remap_rgb(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  if (span.count < lanes) return plain::remap_rgb(source, stride, span, c0, c1, c2);
  const __m256i stride_lanes = _mm256_set1_epi32(static_cast<int>(stride));
  int32_t offset[chunk];
  for (int first = 0; first < span.count; first += chunk) {
    const int begin = first + lanes <= span.count ? first : span.count - lanes;
    const int count = span.count - begin < chunk ? span.count - begin : chunk;
    for (int i = 0; i < count; i += lanes) {
      const int at = i + lanes <= count ? i : count - lanes;  // the last group may overlap the one before
      find_offsets(span.corner + begin + at, stride_lanes, 3, offset + at);
    }
    for (int i = 0; i < count; i += lanes) {
      const int in = i + lanes <= count ? i : count - lanes;
      const int at = begin + in;
      remap_rgb_8(source, stride, span.corner + at, span.fraction + at, offset + in, c0 + at, c1 + at, c2 + at);
    }
  }
}

void remap_gray(const uint8_t* source, ptrdiff_t stride, RemapSpan span, uint8_t* out) {
  if (span.count < lanes) return plain::remap_gray(source, stride, span, out);
  const __m256i stride_lanes = _mm256_set1_epi32(static_cast<int>(stride));
  int32_t offset[lanes];
  for (int i = 0; i < span.count; i += lanes) {
    const int at = i + lanes <= span.count ? i : span.count - lanes;
    find_offsets(span.corner + at, stride_lanes, 1, offset);
    remap_gray_8(source, stride, span.fraction + at, offset, out + at);
  }
}

void split_rgb(const uint8_t* source, int count, uint8_t* c0, uint8_t* c1, uint8_t* c2) {
  constexpr int group = 16;
  if (count < group) return plain::split_rgb(source, count, c0, c1, c2);
  // In three blocks of 16 bytes, channel 0 is at 0, 3, .. 15; 2, 5, .. 14; 1, 4, .. 13. The others follow one and two bytes
  // later.
  const __m128i first0 = _mm_setr_epi8(0, 3, 6, 9, 12, 15, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1);
  const __m128i first1 = _mm_setr_epi8(-1, -1, -1, -1, -1, -1, 2, 5, 8, 11, 14, -1, -1, -1, -1, -1);
  const __m128i first2 = _mm_setr_epi8(-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 1, 4, 7, 10, 13);
  const __m128i second0 = _mm_setr_epi8(1, 4, 7, 10, 13, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1);
  const __m128i second1 = _mm_setr_epi8(-1, -1, -1, -1, -1, 0, 3, 6, 9, 12, 15, -1, -1, -1, -1, -1);
  const __m128i second2 = _mm_setr_epi8(-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 2, 5, 8, 11, 14);
  const __m128i third0 = _mm_setr_epi8(2, 5, 8, 11, 14, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1);
  const __m128i third1 = _mm_setr_epi8(-1, -1, -1, -1, -1, 1, 4, 7, 10, 13, -1, -1, -1, -1, -1, -1);
  const __m128i third2 = _mm_setr_epi8(-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 0, 3, 6, 9, 12, 15);
  const auto join = [](__m128i a, __m128i b, __m128i c) { return _mm_or_si128(_mm_or_si128(a, b), c); };
  for (int i = 0; i < count; i += group) {
    const int at = i + group <= count ? i : count - group;
    const __m128i* block = reinterpret_cast<const __m128i*>(source + 3 * at);
    const __m128i a = _mm_loadu_si128(block);
    const __m128i b = _mm_loadu_si128(block + 1);
    const __m128i c = _mm_loadu_si128(block + 2);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(c0 + at), join(_mm_shuffle_epi8(a, first0), _mm_shuffle_epi8(b, first1),
                                                               _mm_shuffle_epi8(c, first2)));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(c1 + at), join(_mm_shuffle_epi8(a, second0),
                                                               _mm_shuffle_epi8(b, second1),
                                                               _mm_shuffle_epi8(c, second2)));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(c2 + at), join(_mm_shuffle_epi8(a, third0), _mm_shuffle_epi8(b, third1),
                                                               _mm_shuffle_epi8(c, third2)));
  }
}

void stretch_row(const float* value, const float* step, const int32_t* index, const float* weight, int count,
                 float* out) {
  int x = 0;
  for (; x + lanes <= count; x += lanes) {
    const int first = index[x];
    if (index[x + lanes - 1] - first >= lanes) break;  // the map shrinks: neighbours are too far apart for a permutation
    const __m256i at = _mm256_sub_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(index + x)),
                                        _mm256_set1_epi32(first));
    const __m256 v = _mm256_permutevar8x32_ps(_mm256_loadu_ps(value + first), at);
    const __m256 s = _mm256_permutevar8x32_ps(_mm256_loadu_ps(step + first), at);
    _mm256_storeu_ps(out + x, _mm256_add_ps(v, _mm256_mul_ps(_mm256_loadu_ps(weight + x), s)));
  }
  plain::stretch_row(value, step, index + x, weight + x, count - x, out + x);
}

}  // namespace endosdk::avx2
