#include "maps/photometric_consistency.hpp"

#include <algorithm>

#include "kernels/kernels.hpp"
#include "maps/row_disparity.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 16;

// Parts of the misfit per cell of the confidence.
Scale parts_of(const MatchedViews& views, Scale grid) {
  const double cell = 2.0 * views.unit();
  return {1.0 / (RowMisfit::part_bands * RowDisparity::band_period * cell * grid.y), 1.0 / (RowMisfit::part_along * RowDisparity::cells_along * cell * grid.x)};
}

}  // namespace

void PhotometricConsistency::judge(const FloatView& confidence, double reach, const MatchedViews* views, Scale grid,
                                     const RowMisfit* misfit) {
  size_ = {confidence.width, confidence.height};
  const auto width = static_cast<size_t>(confidence.width);
  const size_t count = width * static_cast<size_t>(confidence.height);
  const int workers = thread_count();
  // Allocates all memory before any early return, so that frames after the first allocate nothing.
  seen_.resize(count);
  own_.resize(count);
  cell_of_column_.resize(width);
  scratch_.resize(3 * width * static_cast<size_t>(workers));
  const bool compared = views != nullptr && views->size().width > 0;  // 0: the views are too small
  if (compared) kept_.prepare(misfit->parts().width, misfit->parts().height, size_.width, parts_of(*views, grid));
  if (compared && (views->textured_share() < least_texture || views->most_correlation() < least_correlation)) {
    std::fill(seen_.begin(), seen_.end(), 0.0f);
    std::fill(own_.begin(), own_.end(), 0.0f);
    return;
  }
  for (int x = 0; compared && x < size_.width; ++x) cell_of_column_[static_cast<size_t>(x)] = views->cell_of(x, grid.x, views->size().width);
  std::fill(scratch_.begin(), scratch_.end(), 1.0f);
  const FloatView kept = compared ? misfit->kept() : FloatView{};
  const auto write_rows = [&](int begin, int end, int worker) {
    float* const support = scratch_.data() + 3 * width * static_cast<size_t>(worker);
    float* const odds = support + width;
    for (int y = begin; y < end; ++y) {
      const ptrdiff_t first = static_cast<ptrdiff_t>(y) * size_.width;
      if (compared) {
        const int row = views->cell_of(y, grid.y, views->size().height);
        const float* const supports = views->support(row);
        const float* const factors = views->odds(row);
        for (size_t x = 0; x < width; ++x) {
          support[x] = supports[cell_of_column_[x]];
          odds[x] = factors[cell_of_column_[x]];
        }
        if (kept.data != nullptr) {
          float* const left = odds + width;
          kept_.row(kept, y, 1.0f, worker, left);
          for (size_t x = 0; x < width; ++x) support[x] *= left[x];
        }
      }
      kernels().trust_row({confidence.data + first, support, odds, size_.width, static_cast<float>(reach),
                           seen_.data() + first, own_.data() + first});
    }
  };
  parallel_for(size_.height, rows_per_block, write_rows, workers);
}

}  // namespace endosdk
