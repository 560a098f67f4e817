#include "maps/photometric_consistency.hpp"

#include <algorithm>

#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 16;

}  // namespace

FloatView PhotometricConsistency::supported(const FloatView& confidence, const MatchedViews& views, Scale grid) {
  const bool too_small = views.size().width == 0;  // to be judged
  const bool agree = views.textured_share() >= least_texture && views.most_correlation() >= least_correlation;
  const size_t count = static_cast<size_t>(confidence.width) * static_cast<size_t>(confidence.height);
  // All memory before any way out, so that the first frame takes what later ones need.
  confidence_.resize(count);
  cell_of_column_.resize(static_cast<size_t>(confidence.width));
  const FloatView result = {confidence_.data(), confidence.width, confidence.height};
  if (!too_small && !agree) {
    std::fill(confidence_.begin(), confidence_.end(), 0.0f);
    return result;
  }
  if (too_small) return confidence;
  const Size cells = views.size();
  const auto cell_of = [&](int place, double per_pixel, int most) {
    return std::min(static_cast<int>((place + 0.5) / per_pixel) / (2 * views.unit()), most - 1);
  };
  for (int x = 0; x < confidence.width; ++x) cell_of_column_[static_cast<size_t>(x)] = cell_of(x, grid.x, cells.width);
  const auto write_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      const float* const support = views.support(cell_of(y, grid.y, cells.height));
      const ptrdiff_t first = static_cast<ptrdiff_t>(y) * confidence.width;
      for (int x = 0; x < confidence.width; ++x) {
        confidence_[static_cast<size_t>(first + x)] = confidence.data[first + x] * support[cell_of_column_[static_cast<size_t>(x)]];
      }
    }
  };
  parallel_for(confidence.height, rows_per_block, write_rows);
  return result;
}

}  // namespace endosdk
