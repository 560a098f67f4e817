// Detects whether both frames of a pair show the same view: one camera is connected to both inputs, or one input shows an old
// picture.
#pragma once

#include "images/image.hpp"

namespace endosdk {

// How far apart two frames show their texture, in thousandths of the width. It is measured in tiles all over the frames. In
// each tile, the difference of the frames without light and noise is divided by the slope of the left frame along its rows. Both
// numbers are medians: over the half of the tiles with more texture, and over the other half. They are 0 for frames with equal
// bytes, and at most farthest_displacement, which frames of different shapes get, too. They are NaN where too few tiles have
// texture.
struct FrameDisplacement {
  double textured;
  double rest;
};
FrameDisplacement displacement_of_frames(const ImageView& left, const ImageView& right);

// From this displacement on, the frames have nothing in common at the same place. Then the true displacement is unknown.
constexpr double farthest_displacement = 100.0;

// Two frames with a smaller displacement are the same view: it went through two video chains, which changed it a little, by
// noise or by compression. Real pairs are farther apart: flat boards that face the cameras 6, tissue 12 and more.
constexpr double displacement_of_one_view = 3.0;

// Overlays, such as text or the rim of a round picture, have more texture than tissue and look the same in both frames. Then the
// tissue between them still tells: its tiles were 11.8 and more apart under overlays, and less in two pictures of one view with
// usual noise or compression.
constexpr double rest_of_one_view = 11.0;

}  // namespace endosdk
