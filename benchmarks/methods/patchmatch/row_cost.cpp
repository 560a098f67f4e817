#include "row_cost.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#ifdef __AVX512F__
#include <immintrin.h>
#endif

namespace patchmatch {

#ifdef __AVX512F__

namespace {

constexpr int kLanes = 16;
static_assert(kReadBeyond >= 2 * kLanes, "a block reads two registers from its first match on");

// Where the matches of sixteen pixels lie in the other view's row.
struct Matches {
  __m512i at;     // column before the match
  __m512 share;   // of the column after it
  int base;       // first of the 32 columns that are loaded
  bool together;  // all matches lie within those
};

Matches find(__m512 place, float first, float last_place, __mmask16 used, int width) {
  const __m512 inside =
      _mm512_min_ps(_mm512_max_ps(place, _mm512_setzero_ps()), _mm512_set1_ps(static_cast<float>(width - 1)));
  Matches found;
  found.at = _mm512_min_epi32(_mm512_cvttps_epi32(inside), _mm512_set1_epi32(width - 2));
  found.share = _mm512_sub_ps(inside, _mm512_cvtepi32_ps(found.at));
  // One column early, because the ends were rounded on another way than the lanes.
  const float lowest = std::min(std::max(std::min(first, last_place) - 1.0F, 0.0F), static_cast<float>(width - 2));
  found.base = static_cast<int>(lowest);
  const __m512i beyond = _mm512_sub_epi32(found.at, _mm512_set1_epi32(found.base));
  found.together = _mm512_mask_cmpgt_epu32_mask(used, beyond, _mm512_set1_epi32(2 * kLanes - 2)) == 0;
  return found;
}

// The other view's values at the matches: one of its planes, read between columns.
__m512 read(const float* row, const Matches& matches) {
  __m512 before, after;
  if (matches.together) {  // nearly always: a permutation of two registers is much quicker than a gather
    const __m512 low = _mm512_loadu_ps(row + matches.base), high = _mm512_loadu_ps(row + matches.base + kLanes);
    const __m512i index = _mm512_sub_epi32(matches.at, _mm512_set1_epi32(matches.base));
    before = _mm512_permutex2var_ps(low, index, high);
    after = _mm512_permutex2var_ps(low, _mm512_add_epi32(index, _mm512_set1_epi32(1)), high);
  } else {
    before = _mm512_i32gather_ps(matches.at, row, 4);
    after = _mm512_i32gather_ps(matches.at, row + 1, 4);
  }
  return _mm512_fmadd_ps(matches.share, _mm512_sub_ps(after, before), before);
}

}  // namespace

float row_cost(const View& view, const View& other, const WindowRow& row, float direction, float farthest) {
  const __m512 lanes = _mm512_setr_ps(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const __m512 worst = _mm512_set1_ps(kWorstCost);
  const float step = 1.0F - direction * row.a;
  __m512 sum = _mm512_setzero_ps();
  for (int i = 0; i < row.count; i += kLanes) {
    const int rest = row.count - i;
    const auto used = static_cast<__mmask16>(rest >= kLanes ? 0xffff : (1 << rest) - 1);
    const float left = static_cast<float>(row.left + i);
    const __m512 x = _mm512_add_ps(_mm512_set1_ps(left), lanes);
    const __m512 disparity = _mm512_fmadd_ps(_mm512_set1_ps(row.a), x, _mm512_set1_ps(row.start));
    const __m512 place = _mm512_fnmadd_ps(_mm512_set1_ps(direction), disparity, x);
    const __m512 weight = _mm512_maskz_loadu_ps(used, row.weights + i);
    __mmask16 possible = _mm512_mask_cmp_ps_mask(used, disparity, _mm512_setzero_ps(), _CMP_GE_OQ);
    possible = _mm512_mask_cmp_ps_mask(possible, disparity, _mm512_set1_ps(farthest), _CMP_LE_OQ);
    possible = _mm512_mask_cmp_ps_mask(possible, place, _mm512_setzero_ps(), _CMP_GE_OQ);
    possible = _mm512_mask_cmp_ps_mask(possible, place, _mm512_set1_ps(static_cast<float>(other.width - 1)), _CMP_LE_OQ);
    if (possible == 0) {
      sum = _mm512_fmadd_ps(weight, worst, sum);
      continue;
    }
    const float first = left * step - direction * row.start;
    const Matches matches =
        find(place, first, first + step * static_cast<float>(kLanes - 1), possible, other.width);
    __m512 off[4];
    for (int c = 0; c < 4; ++c) {
      const __m512 own = _mm512_loadu_ps(view.row(c, row.y) + row.left + i);
      off[c] = _mm512_abs_ps(_mm512_sub_ps(own, read(other.row(c, row.y), matches)));
    }
    const __m512 colour = _mm512_min_ps(_mm512_add_ps(_mm512_add_ps(off[0], off[1]), off[2]), _mm512_set1_ps(kColourLimit));
    const __m512 gradient = _mm512_min_ps(off[3], _mm512_set1_ps(kGradientLimit));
    const __m512 cost = _mm512_fmadd_ps(_mm512_set1_ps(1.0F - kGradientShare), colour,
                                        _mm512_mul_ps(_mm512_set1_ps(kGradientShare), gradient));
    sum = _mm512_fmadd_ps(weight, _mm512_mask_blend_ps(possible, worst, cost), sum);
  }
  return _mm512_reduce_add_ps(sum);
}

#else

namespace {

using Channels = float __attribute__((vector_size(16)));

Channels load(const float* from) {
  Channels values;
  std::memcpy(&values, from, sizeof values);
  return values;
}

}  // namespace

// Three passes over the row: where each pixel's match lies, how far its four channels are off, what that costs. The
// first and the last run over many pixels at once, the middle one over the channels of one: gathers are slow.
float row_cost(const View& view, const View& other, const WindowRow& row, float direction, float farthest) {
  const float last = static_cast<float>(view.width - 1);
  const int before_last = view.width - 2;
  const float* own = view.pixels(row.y) + 4 * row.left;
  const float* match = other.pixels(row.y);
  int at[kLargestSide];
  float share[kLargestSide], possible[kLargestSide], differences[4 * kLargestSide];
  for (int i = 0; i < row.count; ++i) {
    const float x = static_cast<float>(row.left + i);
    const float disparity = row.a * x + row.start;
    const float place = x - direction * disparity;
    const float inside = std::min(std::max(place, 0.0F), last);
    at[i] = std::min(static_cast<int>(inside), before_last);
    share[i] = inside - static_cast<float>(at[i]);
    possible[i] = static_cast<float>((disparity >= 0.0F) & (disparity <= farthest) & (place == inside)) * row.weights[i];
  }
  for (int i = 0; i < row.count; ++i) {
    const Channels first = load(match + 4 * at[i]), second = load(match + 4 * at[i] + 4);
    const Channels off = load(own + 4 * i) - (first + share[i] * (second - first));
    std::memcpy(differences + 4 * i, &off, sizeof off);
  }
  float sum = 0.0F;
  for (int i = 0; i < row.count; ++i) {
    const float* off = differences + 4 * i;
    const float colour = std::abs(off[0]) + std::abs(off[1]) + std::abs(off[2]);
    const float cost = (1.0F - kGradientShare) * std::min(colour, kColourLimit) +
                       kGradientShare * std::min(std::abs(off[3]), kGradientLimit);
    sum += row.weights[i] * kWorstCost + possible[i] * (cost - kWorstCost);
  }
  return sum;
}

#endif

}  // namespace patchmatch
