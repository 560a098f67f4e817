// Whether the two views show the same surface where the network matched them.
//
// A network answers whatever it is shown, and is sure of itself even when one camera is covered or the views are of
// different moments. The pictures themselves tell: around a pixel that was matched rightly, the left view and the right
// view at the disparity found rise and fall together.
#pragma once

#include <cstdint>
#include <vector>

#include "images/resize.hpp"
#include "maps/matched_views.hpp"

namespace endosdk {

// Mean correlation below which two views do not belong together. Usable pairs reach 0.35 and more, right ones of clean
// pictures 0.8; views of different scenes stay below 0.1, swapped ones below 0.25. The mean that is measured must lie below it
// by so much that of pairs at this limit one in a thousand does.
constexpr double least_correlation = 0.25;

// Share of the picture with texture beyond its noise, below which nothing can be said of a pair.
constexpr double least_texture = 0.02;

// The unit of the confidence that users see, as a part of the frame's width. A network's own confidence is of one of its pixels. Of
// those, networks have 320 to 960 across the same frame, so the same number would promise errors of 1 to 3 pixels of a
// frame, and no `min_confidence` would suit all.
constexpr double confidence_parts = 480.0;

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class PhotometricConsistency {
 public:
  // Judges the network's confidence by the views, if there are any. `grid` counts its cells per pixel of the views, `reach` the
  // pixels of the network in the unit of the confidence that users see.
  void judge(const FloatView& confidence, double reach, const MatchedViews* views, Scale grid);

  // Good until the next call, 0 everywhere when the views do not belong together. That of errors up to `reach`, for users; and the
  // network's own with what the pictures leave of it, for the expected error.
  FloatView seen() const { return {seen_.data(), size_.width, size_.height}; }
  FloatView own() const { return {own_.data(), size_.width, size_.height}; }

 private:
  Size size_;
  std::vector<int32_t> cell_of_column_;
  std::vector<float> seen_;
  std::vector<float> own_;
  std::vector<float> scratch_;  // per worker: support and odds of a row
};

}  // namespace endosdk
