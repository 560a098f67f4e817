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

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class PhotometricConsistency {
 public:
  // The network's confidence times the share that the pictures leave of it; 0 everywhere when the views do not belong
  // together. `grid` counts cells per pixel of the views. The view that is returned is good until the next call.
  FloatView supported(const FloatView& confidence, const MatchedViews& views, Scale grid);

 private:
  std::vector<int32_t> cell_of_column_;
  std::vector<float> confidence_;
};

}  // namespace endosdk
