#include "maps/coarse_match.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace endosdk {
namespace {

// On each row a patch counts by the Fisher transform of its best correlation, because a strong correlation tells more than a
// weak one. Correlations are limited to this value: beyond it, noise alone would decide.
constexpr double strongest = 0.95;

// The best row must exceed the rows that are not beside it by `least_prominence`. It must also be certain, by so many standard
// errors, that it is not the row on which rectified views match. Of two hundred pairs of different scenes, two pass both tests.
constexpr double least_prominence = 0.085;
constexpr double certain = 2.5;
constexpr int beside = 3;

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

}  // namespace

void CoarseMatch::measure(PatchSearch& search, const MatchedViews& views) {
  exchanged_gain_ = rows_off_ = nothing;
  const Size cells = views.size();
  // Before any early return, so that frames after the first allocate nothing.
  likeness_.resize(PatchSearch::most_patches);
  const int longest = search.longest(), crossed = search.crossed();
  const int margin = longest + patch_reach_along + 1;
  const int edge = farthest_row + patch_reach_down;
  if (cells.width <= 2 * margin || cells.height <= 2 * edge) return;
  double gain = 0.0;
  size_t patches = 0;
  for (int j = 0; j < PatchSearch::down; ++j) {
    for (int i = 0; i < PatchSearch::across; ++i) {
      const int x = margin + i * (cells.width - 1 - 2 * margin) / (PatchSearch::across - 1);
      const int y = edge + j * (cells.height - 1 - 2 * edge) / (PatchSearch::down - 1);
      if (!search.read(x, y)) continue;
      for (int row = -farthest_row; row <= farthest_row; ++row) {
        const auto found = search.correlate(x - longest, y + row, row == 0 ? 2 * longest + 1 : longest + crossed + 1).begin();
        const auto best = [found](int from, int end) { return static_cast<double>(*std::max_element(found + from, found + end)); };
        const double likeness = std::atanh(std::clamp(best(0, longest + crossed + 1), -strongest, strongest));
        likeness_[patches][static_cast<size_t>(row + farthest_row)] = likeness;
        // Both sides are searched over the same distances, so that chance favours neither.
        if (row == 0) gain += best(longest + 1, 2 * longest + 1) - best(0, longest);
      }
      ++patches;
    }
  }
  if (patches < PatchSearch::least_patches) return;
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
