// Photometric consistency: whether the two views show the same surface where the network matched them.
//
// A network always gives an answer. It may give it with high confidence even if one camera is covered or the views were taken
// at different times. The pictures themselves show whether a match is right: around a right match, the brightness of the left
// view and of the right view at the found disparity rise and fall together.
#pragma once

#include <cstdint>
#include <vector>

#include "images/resize.hpp"
#include "maps/matched_views.hpp"
#include "maps/row_misfit.hpp"

namespace endosdk {

// Two views with a lower mean correlation do not belong together. Usable pairs reach 0.35 and more, correct pairs with clean
// pictures 0.8. Views of different scenes stay below 0.1, swapped views below 0.25. A pair is refused only if its measured mean
// is so far below the limit that one in a thousand pairs at the limit would be refused.
constexpr double least_correlation = 0.25;

// Least share of the picture with texture beyond its noise. With less, a pair cannot be judged.
constexpr double least_texture = 0.02;

// The confidence that users see is the probability of an error up to the frame's width divided by this number. A network's own
// confidence is about an error of one network pixel. Networks have 320 to 960 pixels across the same frame. So the same number
// would mean errors of 1 to 3 frame pixels, and no `min_confidence` would suit all networks.
constexpr double confidence_parts = 480.0;

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class PhotometricConsistency {
 public:
  // Judges the network's confidence by the views, if they are given. `grid` is in cells of the confidence per pixel of the
  // views. `reach` is the unit of the confidence that users see, in network pixels. `misfit`, given with the views, says where
  // there is no confidence.
  void judge(const FloatView& confidence, double reach, const MatchedViews* views, Scale grid, const RowMisfit* misfit);

  // Both maps are valid until the next call, and 0 everywhere if the views do not belong together. `seen` is the confidence for
  // users, about errors up to `reach`. `own` is the part of the network's own confidence that the pictures leave; the expected
  // error follows from it.
  FloatView seen() const { return {seen_.data(), size_.width, size_.height}; }
  FloatView own() const { return {own_.data(), size_.width, size_.height}; }

 private:
  Size size_;
  std::vector<int32_t> cell_of_column_;
  std::vector<float> seen_;
  std::vector<float> own_;
  RowResizer kept_;
  std::vector<float> scratch_;  // per worker: support and odds of a row, and what the misfit leaves of it
};

}  // namespace endosdk
