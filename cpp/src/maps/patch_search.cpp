#include "maps/patch_search.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

constexpr float least_variance = 4.0f;  // grey levels squared, for a patch of the left view; half of it for the right view

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

void PatchSearch::take(const MatchedViews& views) {
  views_ = &views;
  cells_ = views.size();
  spread_.resize(count_of(cells_));
  known_.assign(static_cast<size_t>(cells_.height), 0);
  columns_.resize(static_cast<size_t>(4 * cells_.width));
  found_.resize(static_cast<size_t>(cells_.width));
}

// Row y of `spread_`, with values for every cell around which a patch fits.
const float* PatchSearch::spread_of(int y) {
  float* const row = spread_.data() + static_cast<ptrdiff_t>(y) * cells_.width;
  uint8_t& known = known_[static_cast<size_t>(y)];
  if (known != 0) return row;
  known = 1;
  const int along = cells_.width - 2 * patch_reach_along;
  float* const sums = columns_.data();
  float* const squares = sums + cells_.width;
  float* const whole = squares + cells_.width;
  float* const whole_squares = whole + cells_.width;
  constexpr float flattest = 0.5f * least_variance * patch_cells;
  std::fill(sums, whole, 0.0f);
  for (int r = -patch_reach_down; r <= patch_reach_down; ++r) add_squares(views_->levels(1, y + r), cells_.width, sums, squares);
  sum_along(sums, patch_width, along, whole);
  sum_along(squares, patch_width, along, whole_squares);
  float* const out = row + patch_reach_along;
  for (int x = 0; x < along; ++x) {
    const float rest = whole_squares[x] - whole[x] * whole[x] * (1.0f / patch_cells);
    out[x] = rest > flattest ? 1.0f / std::sqrt(rest) : 0.0f;
  }
  return row;
}

bool PatchSearch::read(int x, int y) {
  float sum = 0.0f;
  size_t i = 0;
  for (int r = -patch_reach_down; r <= patch_reach_down; ++r) {
    const float* const row = views_->levels(0, y + r) + x;
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

const std::vector<float>& PatchSearch::correlate(int x, int y, int count) {
  const ptrdiff_t stride = cells_.width;
  kernels().patch_products({patch_.data(), views_->levels(1, y - patch_reach_down) + x - patch_reach_along, stride, count, found_.data()});
  const float* const spread = spread_of(y) + x;
  const float share = 1.0f / deviation_;
  for (int i = 0; i < count; ++i) found_[static_cast<size_t>(i)] *= share * spread[i];
  return found_;
}

}  // namespace endosdk
