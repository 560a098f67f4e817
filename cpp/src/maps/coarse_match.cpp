#include "maps/coarse_match.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace endosdk {
namespace {

// A picture has a hundred patches, which overlap.
constexpr int across = 10;
constexpr int down = 10;
constexpr size_t most_patches = size_t{across} * down;

constexpr float least_variance = 4.0f;  // grey levels squared, for a patch of the left view; half of it for the right view
constexpr size_t least_patches = 16;

// On each row a patch counts by the Fisher transform of its best correlation, because a strong correlation tells more than a
// weak one. Correlations are limited to this value: beyond it, noise alone would decide.
constexpr double strongest = 0.95;

// The best row must exceed the rows that are not beside it by `least_prominence`. It must also be certain, by so many standard
// errors, that it is not the row on which rectified views match. Of two hundred pairs of different scenes, two pass both tests.
constexpr double least_prominence = 0.085;
constexpr double certain = 2.5;
constexpr int beside = 3;

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

// Sums over `count` neighbours along a row.
void sum_along(const float* values, int count, int cells, float* __restrict out) {
  for (int x = 0; x < cells; ++x) out[x] = 0.0f;
  for (int k = 0; k < count; ++k) {
    for (int x = 0; x < cells; ++x) out[x] += values[x + k];
  }
}

void add_squares(const float* values, int cells, float* __restrict sums, float* __restrict squares) {
  for (int x = 0; x < cells; ++x) {
    sums[x] += values[x];
    squares[x] += values[x] * values[x];
  }
}

}  // namespace

// Computes `spread_` for every cell of the right view around which a patch fits.
void CoarseMatch::find_spread(const MatchedViews& views) {
  const Size cells = views.size();
  const int along = cells.width - 2 * patch_reach_along;
  float* const sums = columns_.data();
  float* const squares = sums + cells.width;
  float* const whole = squares + cells.width;
  float* const whole_squares = whole + cells.width;
  constexpr float flattest = 0.5f * least_variance * patch_cells;
  for (int y = patch_reach_down; y + patch_reach_down < cells.height; ++y) {
    std::fill(sums, whole, 0.0f);
    for (int r = -patch_reach_down; r <= patch_reach_down; ++r) add_squares(views.levels(1, y + r), cells.width, sums, squares);
    sum_along(sums, patch_width, along, whole);
    sum_along(squares, patch_width, along, whole_squares);
    float* const out = spread_.data() + static_cast<ptrdiff_t>(y) * cells.width + patch_reach_along;
    for (int x = 0; x < along; ++x) {
      const float rest = whole_squares[x] - whole[x] * whole[x] * (1.0f / patch_cells);
      out[x] = rest > flattest ? 1.0f / std::sqrt(rest) : 0.0f;
    }
  }
}

// Reads a patch of the left view. Returns false if it is flat.
bool CoarseMatch::read_patch(const MatchedViews& views, int x, int y) {
  float sum = 0.0f;
  size_t i = 0;
  for (int r = -patch_reach_down; r <= patch_reach_down; ++r) {
    const float* const row = views.levels(0, y + r) + x;
    for (int c = -patch_reach_along; c <= patch_reach_along; ++c) sum += patch_[i++] = row[c];
  }
  const float mean = sum / patch_cells;
  float squares = 0.0f;
  for (float& value : patch_) {
    value -= mean;
    squares += value * value;
  }
  deviation_ = std::sqrt(squares);
  return squares > least_variance * patch_cells;
}

// Correlates the patch with the right view around `count` cells of row y, from x on.
void CoarseMatch::correlate(const MatchedViews& views, int x, int y, int count) {
  const ptrdiff_t stride = views.size().width;
  kernels().patch_products({patch_.data(), views.levels(1, y - patch_reach_down) + x - patch_reach_along, stride, count, found_.data()});
  const float* const spread = spread_.data() + y * stride + x;
  const float share = 1.0f / deviation_;
  for (int i = 0; i < count; ++i) found_[static_cast<size_t>(i)] *= share * spread[i];
}

void CoarseMatch::measure(const MatchedViews& views) {
  exchanged_gain_ = rows_off_ = nothing;
  const Size cells = views.size();
  // Allocates all memory before any early return, so that frames after the first allocate nothing.
  spread_.resize(count_of(cells));
  columns_.resize(static_cast<size_t>(4 * cells.width));
  found_.resize(static_cast<size_t>(cells.width));
  likeness_.resize(most_patches);
  const int longest = cells.width / 4;
  const int margin = longest + patch_reach_along + 1;
  const int edge = farthest_row + patch_reach_down;
  if (cells.width <= 2 * margin || cells.height <= 2 * edge) return;
  // The optical axes of unrectified views may cross. Then matches of far surfaces lie a little on the other side.
  const int crossed = cells.width / 16;
  find_spread(views);
  double gain = 0.0;
  size_t patches = 0;
  for (int j = 0; j < down; ++j) {
    for (int i = 0; i < across; ++i) {
      const int x = margin + i * (cells.width - 1 - 2 * margin) / (across - 1);
      const int y = edge + j * (cells.height - 1 - 2 * edge) / (down - 1);
      if (!read_patch(views, x, y)) continue;
      const auto best = [this](int from, int end) { return static_cast<double>(*std::max_element(found_.begin() + from, found_.begin() + end)); };
      for (int row = -farthest_row; row <= farthest_row; ++row) {
        correlate(views, x - longest, y + row, row == 0 ? 2 * longest + 1 : longest + crossed + 1);
        const double likeness = std::atanh(std::clamp(best(0, longest + crossed + 1), -strongest, strongest));
        likeness_[patches][static_cast<size_t>(row + farthest_row)] = likeness;
        // Both sides are searched over the same distances, so that chance favours neither.
        if (row == 0) gain += best(longest + 1, 2 * longest + 1) - best(0, longest);
      }
      ++patches;
    }
  }
  if (patches < least_patches) return;
  exchanged_gain_ = gain / static_cast<double>(patches);
  rows_off_ = find_rows(patches);
}

// A single patch may correlate by chance on any row. All patches together do so only on the right row.
double CoarseMatch::find_rows(size_t patches) const {
  const auto count = static_cast<double>(patches);
  Likeness mean{};
  for (size_t i = 0; i < patches; ++i) {
    for (size_t row = 0; row < mean.size(); ++row) mean[row] += likeness_[i][row] / count;
  }
  const auto best = static_cast<int>(std::max_element(mean.begin(), mean.end()) - mean.begin());
  const auto of = [&](int row) { return mean[static_cast<size_t>(row)]; };
  double others = -strongest;
  for (int row = 0; row < rows_tried; ++row) {
    if (std::abs(row - best) > beside) others = std::max(others, of(row));
  }
  if (best == farthest_row || of(best) - others < least_prominence) return nothing;
  double squares = 0.0;
  const double gain = of(best) - of(farthest_row);
  for (size_t i = 0; i < patches; ++i) {
    const double rest = likeness_[i][static_cast<size_t>(best)] - likeness_[i][farthest_row] - gain;
    squares += rest * rest;
  }
  if (gain < certain * std::sqrt(squares / (count - 1.0) / count)) return nothing;
  if (best == 0 || best == rows_tried - 1) return best - farthest_row;
  // The top of a parabola through the best row and its neighbours.
  const double bend = of(best - 1) - 2.0 * of(best) + of(best + 1);
  return best - farthest_row + (bend < 0.0 ? 0.5 * (of(best - 1) - of(best + 1)) / bend : 0.0);
}

}  // namespace endosdk
