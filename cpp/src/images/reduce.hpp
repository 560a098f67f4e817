// Reduction of a frame by a whole factor: the mean of blocks of pixels, so that sampling a smaller picture out of a large
// frame shows no patterns that are not there.
#pragma once

#include <cstdint>
#include <vector>

#include "images/image.hpp"
#include "images/size.hpp"

namespace endosdk {

// The largest whole factor by which a frame may be reduced and still be no smaller than the picture made of it.
int reduction(Size raw, Size picture);

// Size after reduction; the last block of a row or column may be a part of one.
Size reduced_size(Size raw, int factor);

// A reduced frame and what its making needs; kept between frames so that nothing is allocated.
struct ReducedFrame {
  std::vector<uint8_t> pixels;
  std::vector<uint16_t> sums;  // of each worker
};

// Writes the reduced frame as packed interleaved rows and returns a view of it. Each value is the mean of a block of
// factor x factor values (factor at least 2), or of what there is of it, rounded half up.
ImageView reduce(const ImageView& source, int factor, ReducedFrame& out);

}  // namespace endosdk
