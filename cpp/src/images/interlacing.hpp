// Frames of an interlaced camera hold two moments: one in the even rows, the other in the odd rows.
#pragma once

#include "images/image.hpp"

namespace endosdk {

// Share of the tiles of a raw frame in which neighbouring rows differ clearly more than rows two apart. In a frame of one moment
// they differ less, and if there is only noise, as much. NaN for frames that are too small.
double combed_share(const ImageView& frame);

}  // namespace endosdk
