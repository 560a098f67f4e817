// Confidence in one unit, whatever width the network saw: of an error up to 1/480 of the frame's width.
//
// A network's own confidence is of one of its pixels. Of those, networks have 320 to 960 across the same frame, so the
// same number would promise errors of 1 to 3 pixels of a frame, and no `min_confidence` would suit all.
#pragma once

#include <vector>

#include "images/resize.hpp"

namespace endosdk {

// The unit, as a part of the frame's width.
constexpr double confidence_parts = 480.0;

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class RelativeConfidence {
 public:
  // That of errors up to `reach` pixels of the network, of that up to one. The view that is returned is good until the
  // next call.
  FloatView of(const FloatView& confidence, double reach);

 private:
  std::vector<float> confidence_;
};

}  // namespace endosdk
