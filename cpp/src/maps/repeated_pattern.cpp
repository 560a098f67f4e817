#include "maps/repeated_pattern.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <limits>
#include <vector>

namespace endosdk {
namespace {

constexpr float least_likeness = 0.6f;  // a patch without such a match is occluded, or noise hides it
constexpr float nearly = 0.03f;         // by so much, at most, a rival correlates less
constexpr int apart = 5;                // cells from the best match to a rival

using Places = std::vector<float>::const_iterator;

// Blurred textures have wide maxima. So a rival is a place beyond the maximum that holds the best match.
bool has_rival(Places begin, Places end, Places best) {
  const float limit = *best - nearly;
  const auto is_near = [limit](float likeness) { return likeness > limit; };
  const auto beyond = [&](const auto& from, const auto& last) {
    const auto fallen = std::find_if_not(from, last, is_near);
    return std::any_of(std::max(fallen, from + std::min<ptrdiff_t>(apart, last - from)), last, is_near);
  };
  return beyond(best, end) || beyond(std::make_reverse_iterator(best + 1), std::make_reverse_iterator(begin));
}

}  // namespace

double share_of_rivals(PatchSearch& search, const MatchedViews& views) {
  constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  const Size cells = views.size();
  const int longest = search.longest(), crossed = search.crossed();
  // At the left border, half of the searched cells lie inside.
  const int first = longest / 2 + patch_reach_along;
  const int last = cells.width - 1 - patch_reach_along;
  const int edge = patch_reach_down;
  if (last <= first || cells.height <= 2 * edge) return nothing;
  size_t judged = 0, rivals = 0;
  for (int j = 0; j < PatchSearch::down; ++j) {
    const int y = edge + j * (cells.height - 1 - 2 * edge) / (PatchSearch::down - 1);
    for (int i = 0; i < PatchSearch::across; ++i) {
      const int x = first + i * (last - first) / (PatchSearch::across - 1);
      if (!search.read(x, y)) continue;
      const int from = std::max(patch_reach_along, x - longest);
      const int count = std::min(last, x + crossed) + 1 - from;
      const auto found = search.correlate(from, y, count).begin();
      const auto best = std::max_element(found, found + count);
      if (*best < least_likeness) continue;
      ++judged;
      rivals += has_rival(found, found + count, best) ? 1 : 0;
    }
  }
  return judged < PatchSearch::least_patches ? nothing : static_cast<double>(rivals) / static_cast<double>(judged);
}

}  // namespace endosdk
