// Correlation of two views where they were matched. The file is compiled once per instruction set: plain loops that the
// compiler vectorises. Sums have a fixed order, so that every set rounds alike.
#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"
#include "kernels/sharpness.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

constexpr int chunk = 128;
constexpr float nothing = __builtin_nanf("");

// Correlation at which the pictures contradict a match, and correlation from which they fully support it. Wet tissue shines
// differently in the two views. So windows of right matches sometimes correlate badly; windows of wrong matches correlate at
// random.
constexpr float contradicted = 0.0f;
constexpr float supported = 0.3f;

// A network makes its large errors at jumps of the disparity, and few on surfaces, whatever its own confidence says of both. So
// the odds of its answer are multiplied by a factor, which falls from `even_odds` where the disparity is even. It falls with the
// part of the change around a cell that lies right at the cell: 0 on an even surface, a third on a slope, 1 at a jump. Changes
// well below `gentle` columns are neither.
constexpr float even_odds = 45.0f;
constexpr float fall = 14.0f;  // of the logarithm of the odds, down to a jump
constexpr float gentle = 3.0f;
// At the rim of the field of view, networks are more often right than they say.
constexpr float rim_odds = 4.0f;
constexpr float far_apart = 1000.0f;  // columns: more is a jump of any size

// Grey level from which a cell shows glare or its edge. Glare moves with the camera, so it lies on another place of the tissue in
// the other view.
constexpr float glaring = 225.0f;

constexpr float least_variance = 0.3f;  // grey levels squared, beyond the noise; less tells nothing
constexpr float least_weight = 0.25f * static_cast<float>(correlation_weights);  // of the cells with a match in a window

template <int unit>
void add_blocks(const BrightnessRow& row, int given_unit, float* __restrict out) {
  const int u = unit > 0 ? unit : given_unit;
  const float share = 1.0f / static_cast<float>(4 * 2 * u * u);
  for (int i = 0; i < row.count; ++i) {
    int sum = 0;
    for (int y = 0; y < 2 * u; ++y) {
      const ptrdiff_t at = y * row.stride + static_cast<ptrdiff_t>(i) * u;
      for (int x = 0; x < u; ++x) sum += row.channel[0][at + x] + 2 * row.channel[1][at + x] + row.channel[2][at + x];
    }
    out[i] = static_cast<float>(sum) * share;
  }
}

float clamped(float value, float low, float high) {
  const float floor = value > low ? value : low;
  return floor < high ? floor : high;
}

// Weighted sums of one plane over the window along a row. `values` begin correlation_reach cells before the first cell. The
// weights 1 to 6 to 1 come from sums of six over sums of six.
void sum_along(const float* values, int cells, float* __restrict out) {
  static_assert(correlation_window == 11);
  float threes[chunk + 8];
  float sixes[chunk + 5];
  for (int first = 0; first < cells; first += chunk) {
    const int count = cells - first < chunk ? cells - first : chunk;
    const float* const from = values + first;
    for (int i = 0; i < count + 8; ++i) threes[i] = (from[i] + from[i + 1]) + from[i + 2];
    for (int i = 0; i < count + 5; ++i) sixes[i] = threes[i] + threes[i + 3];
    for (int i = 0; i < count; ++i) {
      const float before = (sixes[i] + sixes[i + 1]) + sixes[i + 2];
      out[first + i] = before + ((sixes[i + 3] + sixes[i + 4]) + sixes[i + 5]);
    }
  }
}

// Weighted sums of one plane down the rows of the window.
void sum_down(const float* const* rows, ptrdiff_t from, int count, float* __restrict out) {
  const float* window[correlation_window];
  for (int w = 0; w < correlation_window; ++w) window[w] = rows[w] + from;
  for (int i = 0; i < count; ++i) {
    float sum = static_cast<float>(correlation_weight(correlation_reach)) * window[correlation_reach][i];
    for (int w = 0; w < correlation_reach; ++w) {
      sum += static_cast<float>(correlation_weight(w)) * (window[w][i] + window[correlation_window - 1 - w][i]);
    }
    out[i] = sum;
  }
}

void multiply(const float* a, const float* b, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] = a[i] * b[i];
}

// Reads the left view, and the right view at the match. Cells without a match, or with glare, give 0.
void read_matches(const MatchRow& row, float* __restrict counts, float* __restrict left, float* __restrict right) {
  const int columns = row.columns;
  const float end = static_cast<float>(columns - 1);
  for (int i = 0; i < row.cells; ++i) {
    const float at = static_cast<float>(2 * i) - row.disparity[i];
    const int inside = (at >= 0.0f) & (at <= end);  // false for NaN
    const float position = inside ? at : 0.0f;
    int column = static_cast<int>(position);
    column = column < columns - 2 ? column : columns - 2;
    const float share = position - static_cast<float>(column);
    const float there = row.right[column] + share * (row.right[column + 1] - row.right[column]);
    const float here = row.left[2 * i];
    const int counted = inside & (here <= glaring) & (there <= glaring);
    const float one = counted ? 1.0f : 0.0f;
    counts[i] = one;
    left[i] = one * here;
    right[i] = one * there;
  }
}

// Computes the correlation from the sums over a window, and the share of the confidence that it leaves.
void correlate(const float (&sums)[correlation_sums][chunk], float left_noise, float right_noise, int count,
               float* __restrict correlation, float* __restrict support) {
  const float flat = least_variance + (left_noise > right_noise ? left_noise : right_noise);
  for (int i = 0; i < count; ++i) {
    const float share = 1.0f / (sums[0][i] > 1.0f ? sums[0][i] : 1.0f);
    const float left = sums[1][i] * share;
    const float right = sums[2][i] * share;
    const float left_varies = (sums[3][i] * share - left * left) - left_noise;
    const float right_varies = (sums[4][i] * share - right * right) - right_noise;
    const float together = sums[5][i] * share - left * right;
    const float left_scale = left_varies > flat ? left_varies : flat;
    const float right_scale = right_varies > flat ? right_varies : flat;
    const float found = clamped(together / __builtin_sqrtf(left_scale * right_scale), -1.0f, 1.0f);
    const float pictures = clamped((found - contradicted) * (1.0f / (supported - contradicted)), 0.0f, 1.0f);
    const int textured = ((left_varies > flat) | (right_varies > flat)) & (sums[0][i] >= least_weight);
    correlation[i] = textured ? found : nothing;
    support[i] = textured ? pictures : 1.0f;
  }
}

// The largest and the smallest values of each column over a window's rows. NaN is left out.
template <int window>
void extremes_down(const float* const* given, int count, float* __restrict high, float* __restrict low) {
  const float* rows[window];
  for (int y = 0; y < window; ++y) rows[y] = given[y];
  for (int i = 0; i < count; ++i) {
    float most = -__builtin_inff();
    float least = __builtin_inff();
    for (int y = 0; y < window; ++y) {
      const float d = rows[y][i];
      most = d > most ? d : most;
      least = d < least ? d : least;
    }
    high[i] = most;
    low[i] = least;
  }
}

// How far the values of a window lie apart, from the extremes of its columns.
template <int window>
void spread_along(const float* high, const float* low, int count, float* __restrict spread) {
  for (int i = 0; i < count; ++i) {
    float most = high[i];
    float least = low[i];
    for (int x = 1; x < window; ++x) {
      most = high[i + x] > most ? high[i + x] : most;
      least = low[i + x] < least ? low[i + x] : least;
    }
    const float apart = most - least;
    spread[i] = apart < far_apart ? apart : far_apart;
  }
}

// Gives 1 where any cell of the window is not compared, and 0 elsewhere.
void find_rim(const float* const (&around)[edge_window], int count, float* __restrict rim) {
  float unknown[chunk + edge_window - 1];
  const float* rows[edge_window];
  for (int y = 0; y < edge_window; ++y) rows[y] = around[y];
  for (int i = 0; i < count + edge_window - 1; ++i) {
    float any = 0.0f;
    for (int y = 0; y < edge_window; ++y) any = rows[y][i] == rows[y][i] ? any : 1.0f;
    unknown[i] = any;
  }
  for (int i = 0; i < count; ++i) {
    float any = unknown[i];
    for (int x = 1; x < edge_window; ++x) any = unknown[i + x] > any ? unknown[i + x] : any;
    rim[i] = any;
  }
}

// Finds the factor on the odds from the disparities around the cells, see `even_odds`. `around` holds the rows around those of
// the cells, each from edge_reach cells before them on.
void find_odds(const float* const (&around)[edge_window], int count, float* __restrict odds) {
  constexpr int inner_window = 3;
  constexpr int margin = (edge_window - inner_window) / 2;
  float high[chunk + edge_window - 1];
  float low[chunk + edge_window - 1];
  float inner[chunk];
  float outer[chunk];
  float rim_at[chunk];
  extremes_down<inner_window>(around + margin, count + edge_window - 1, high, low);
  spread_along<inner_window>(high + margin, low + margin, count, inner);
  extremes_down<edge_window>(around, count + edge_window - 1, high, low);
  spread_along<edge_window>(high, low, count, outer);
  find_rim(around, count, rim_at);
  for (int i = 0; i < count; ++i) {
    const float jump = inner[i] / (outer[i] + gentle);
    const int known = inner[i] >= 0.0f;  // negative where no cell around is compared
    const float even = (known ? even_odds : 1.0f) * (rim_at[i] != 0.0f ? rim_odds : 1.0f);
    odds[i] = even * (1.0f - one_minus_exp(known ? fall * jump : 0.0f));
  }
}

template <bool one_pixel>
void trust_cells_within(const TrustRow& row, float* __restrict seen, float* __restrict own) {
  for (int i = 0; i < row.count; ++i) {
    const float confidence = row.confidence[i];
    const float within = one_pixel ? confidence : confidence_within(confidence, row.reach);
    const float odds = row.odds[i];
    seen[i] = row.support[i] * (odds * within / (1.0f + (odds - 1.0f) * within));
    own[i] = row.support[i] * confidence;
  }
}

void add_patch_row(const float* patch, const float* view, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) {
    float sum = out[i];
    for (int c = 0; c < patch_width; ++c) sum += patch[c] * view[i + c];
    out[i] = sum;
  }
}

}  // namespace

void brightness_row(const BrightnessRow& row) {
  float* const means = row.scratch;
  switch (row.unit) {
    case 1: add_blocks<1>(row, 1, means); break;
    case 2: add_blocks<2>(row, 2, means); break;
    default: add_blocks<0>(row, row.unit, means); break;
  }
  const int last = row.count - 1;
  float* const out = row.out;
  out[0] = 0.25f * (3.0f * means[0] + means[last > 0 ? 1 : 0]);
  for (int i = 1; i < last; ++i) out[i] = 0.25f * ((means[i - 1] + means[i + 1]) + 2.0f * means[i]);
  if (last > 0) out[last] = 0.25f * (means[last - 1] + 3.0f * means[last]);
}

void match_row(const MatchRow& row) {
  const ptrdiff_t stride = row.cells + 2 * correlation_reach;
  float* planes[correlation_sums];
  for (int p = 0; p < correlation_sums; ++p) {
    float* const plane = row.scratch + p * stride;
    for (int i = 0; i < correlation_reach; ++i) plane[i] = plane[correlation_reach + row.cells + i] = 0.0f;
    planes[p] = plane + correlation_reach;
  }
  read_matches(row, planes[0], planes[1], planes[2]);
  multiply(planes[1], planes[1], row.cells, planes[3]);
  multiply(planes[2], planes[2], row.cells, planes[4]);
  multiply(planes[1], planes[2], row.cells, planes[5]);
  for (int p = 0; p < correlation_sums; ++p) {
    sum_along(row.scratch + p * stride, row.cells, row.sums + static_cast<ptrdiff_t>(p) * row.cells);
  }
}

void correlation_row(const CorrelationRow& row) {
  for (int first = 0; first < row.cells; first += chunk) {
    const int count = row.cells - first < chunk ? row.cells - first : chunk;
    float sums[correlation_sums][chunk];
    for (int p = 0; p < correlation_sums; ++p) sum_down(row.sums, static_cast<ptrdiff_t>(p) * row.cells + first, count, sums[p]);
    correlate(sums, row.left_noise, row.right_noise, count, row.correlation + first, row.support + first);
    const float* around[edge_window];
    for (int y = 0; y < edge_window; ++y) around[y] = row.disparity[y] + first;
    find_odds(around, count, row.odds + first);
  }
}

void trust_row(const TrustRow& row) {
  // With the usual reach of 1, no logarithms are needed. They take as long as everything else.
  row.reach == 1.0f ? trust_cells_within<true>(row, row.seen, row.own) : trust_cells_within<false>(row, row.seen, row.own);
}

void add_known(const float* values, int count, float* __restrict sums, float* __restrict squares, float* __restrict known) {
  for (int i = 0; i < count; ++i) {
    const bool is_known = values[i] == values[i];
    const float value = is_known ? values[i] : 0.0f;
    sums[i] += value;
    squares[i] += value * value;
    known[i] += is_known ? 1.0f : 0.0f;
  }
}

void patch_products(const PatchProducts& row) {
  for (int i = 0; i < row.count; ++i) row.out[i] = 0.0f;
  for (int r = 0; r < patch_cells / patch_width; ++r) {
    add_patch_row(row.patch + r * patch_width, row.view + r * row.stride, row.count, row.out);
  }
}

}  // namespace endosdk::ENDOSDK_ISA
