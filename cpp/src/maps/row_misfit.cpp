#include "maps/row_misfit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>

#include "geometry/median.hpp"

namespace endosdk {
namespace {

constexpr size_t least_measured = 10;  // of the 36 of a part

// Median distance from the median, over the median: what bends the picture moves a whole part one way. Wrong matches stray.
constexpr float most_scatter = 0.6f;

// What bends or tears a picture reaches over several parts. A part alone is more often wrong matches that happen to agree.
constexpr double weight_alone = 0.5;

// Matches are wrong along the rows where they are off their rows by so many times the misfit that counts, and beside it.
constexpr float without_depth = 1.5f;

}  // namespace

void RowMisfit::prepare(int bands, int along) {
  along_ = along;
  across_ = along / part_along;
  down_ = bands / part_bands;
  share_ = std::numeric_limits<double>::quiet_NaN();
  const auto parts = static_cast<size_t>(across_ * down_);
  found_.resize(parts);
  kept_.resize(parts);
  values_.reserve(static_cast<size_t>(part_bands * part_along));
}

float RowMisfit::misfit_of(const std::vector<float>& rest, int row, int column, float least) {
  values_.clear();
  for (int band = row * part_bands; band < (row + 1) * part_bands; ++band) {
    const float* const from = rest.data() + static_cast<ptrdiff_t>(band) * along_ + column * part_along;
    std::copy_if(from, from + part_along, std::back_inserter(values_), [](float value) { return std::isfinite(value); });
  }
  if (values_.size() < least_measured) return 0.0f;
  const float middle = median(values_);
  if (!(std::abs(middle) > least)) return 0.0f;
  for (float& value : values_) value = std::abs(value - middle);
  return median(values_) < most_scatter * std::abs(middle) ? std::abs(middle) : 0.0f;
}

int RowMisfit::parts_around(int row, int column, float least) const {
  int count = 0;
  for (int y = std::max(row - 1, 0); y <= std::min(row + 1, down_ - 1); ++y) {
    for (int x = std::max(column - 1, 0); x <= std::min(column + 1, across_ - 1); ++x) {
      count += found_[static_cast<size_t>(y * across_ + x)] > least ? 1 : 0;
    }
  }
  return count;
}

void RowMisfit::find(const std::vector<float>& rest, float least) {
  if (found_.empty()) return;
  for (int row = 0; row < down_; ++row) {
    for (int column = 0; column < across_; ++column) {
      found_[static_cast<size_t>(row * across_ + column)] = misfit_of(rest, row, column, least);
    }
  }
  double count = 0.0;
  for (int row = 0; row < down_; ++row) {
    for (int column = 0; column < across_; ++column) {
      const auto part = static_cast<size_t>(row * across_ + column);
      kept_[part] = parts_around(row, column, without_depth * least) > 0 ? 0.0f : 1.0f;
      if (found_[part] > least) count += parts_around(row, column, least) > 1 ? 1.0 : weight_alone;
    }
  }
  share_ = count / static_cast<double>(found_.size());
}

FloatView RowMisfit::kept() const {
  if (!(share_ >= distorted_share)) return {};
  return {kept_.data(), across_, down_};
}

}  // namespace endosdk
