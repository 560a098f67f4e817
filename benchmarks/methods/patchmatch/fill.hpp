// What is done with pixels whose two views disagree: section 3.4 of the paper.
#pragma once

#include <vector>

#include "matching_cost.hpp"

namespace patchmatch {

// Write the left view's disparities, NaN where the right view's differ by more than 1 px at the match.
void check(const std::vector<Plane>& left, const std::vector<Plane>& right, int height, int width, float* disparity);

// Give each NaN the smaller of what the planes of the nearest valid pixels of its row say there.
void fill(const std::vector<Plane>& planes, int height, int width, int max_disparity, const float* checked,
          float* filled);

// Replace each pixel that was filled by the weighted median of its window, so that the fill shows no streaks.
void smooth(const View& view, int radius, const float* checked, const std::vector<float>& filled, int first_row,
            int last_row, float* out);

}  // namespace patchmatch
