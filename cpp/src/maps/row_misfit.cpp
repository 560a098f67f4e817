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

bool RowMisfit::misfits(const std::vector<float>& rest, int row, int column, float least) {
  values_.clear();
  for (int band = row * part_bands; band < (row + 1) * part_bands; ++band) {
    const float* const from = rest.data() + static_cast<ptrdiff_t>(band) * along_ + column * part_along;
    std::copy_if(from, from + part_along, std::back_inserter(values_), [](float value) { return std::isfinite(value); });
  }
  if (values_.size() < least_measured) return false;
  const float middle = median(values_);
  if (!(std::abs(middle) > least)) return false;
  for (float& value : values_) value = std::abs(value - middle);
  return median(values_) < most_scatter * std::abs(middle);
}

void RowMisfit::find(const std::vector<float>& rest, float least) {
  if (found_.empty()) return;
  for (int row = 0; row < down_; ++row) {
    for (int column = 0; column < across_; ++column) {
      found_[static_cast<size_t>(row * across_ + column)] = misfits(rest, row, column, least) ? 1 : 0;
    }
  }
  const auto count = std::count(found_.begin(), found_.end(), 1);
  share_ = static_cast<double>(count) / static_cast<double>(found_.size());
  for (int row = 0; row < down_; ++row) {
    for (int column = 0; column < across_; ++column) {
      bool beside = false;
      for (int y = std::max(row - 1, 0); y <= std::min(row + 1, down_ - 1); ++y) {
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, across_ - 1); ++x) {
          beside = beside || found_[static_cast<size_t>(y * across_ + x)] != 0;
        }
      }
      kept_[static_cast<size_t>(row * across_ + column)] = beside ? 0.0f : 1.0f;
    }
  }
}

FloatView RowMisfit::kept() const {
  if (!(share_ >= distorted_share)) return {};
  return {kept_.data(), across_, down_};
}

}  // namespace endosdk
