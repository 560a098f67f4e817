// Reduction of a frame by a whole factor: the mean of blocks of pixels, so that sampling a smaller picture out of a large
// frame shows no patterns that are not there.
#pragma once

#include <cstdint>
#include <vector>

#include "image.hpp"
#include "size.hpp"

namespace endosdk {

// The largest whole factor by which a frame may be reduced and still be no smaller than the picture made of it.
int reduction(Size raw, Size picture);

// Size after reduction; what fills no block at the right and bottom is left out.
Size reduced_size(Size raw, int factor);

// Writes the reduced frame as packed interleaved rows and returns a view of it. `pixels` grows when it must. Each
// value is the sum of factor x factor values (factor at least 2), divided with rounding half up.
ImageView reduce(const ImageView& source, int factor, std::vector<uint8_t>& pixels);

}  // namespace endosdk
