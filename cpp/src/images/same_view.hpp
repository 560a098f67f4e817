// Whether two frames are one view, given twice: one camera that is connected to both inputs, or an old picture in one eye.
#pragma once

#include "images/image.hpp"

namespace endosdk {

// How far apart two frames show their texture, thousandths of the width: in tiles all over them, what differs, beside light
// and noise, as a share of how steep the left frame is along its rows; the median of the half with more texture. 0 for frames
// of the same bytes, at most farthest_displacement, which frames of different shapes have too; not a number where too few
// tiles have texture.
double displacement_of_frames(const ImageView& left, const ImageView& right);

// From there on frames have nothing in common at the same place, and nothing tells how far apart they are.
constexpr double farthest_displacement = 100.0;

// Frames less apart are one view, passed through two chains that changed it by a bit, by noise or by compression. Pairs of
// rigs are farther apart: flat boards that face the cameras 6, tissue 12 and more.
constexpr double displacement_of_one_view = 3.0;

}  // namespace endosdk
