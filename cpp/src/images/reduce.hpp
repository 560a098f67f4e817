// Reduction of a frame by a whole factor. It takes the mean of blocks of pixels, so that a small picture sampled from a large
// frame shows no aliasing.
#pragma once

#include <cstdint>
#include <vector>

#include "images/image.hpp"
#include "images/size.hpp"

namespace endosdk {

// The largest whole factor by which a frame can be reduced without becoming smaller than `picture`.
int reduction(Size raw, Size picture);

// Size after reduction. The last block of a row or column may be incomplete.
Size reduced_size(Size raw, int factor);

// A reduced frame, and the scratch memory of its reduction. It is kept between frames, so that nothing is allocated.
struct ReducedFrame {
  std::vector<uint8_t> pixels;
  std::vector<uint16_t> sums;  // scratch memory per worker
};

// Writes the reduced frame as packed interleaved rows, and returns a view of it. Each value is the mean, rounded half up, of a
// block of factor x factor values, or of the part of the block that lies in the frame. The factor is at least 2.
ImageView reduce(const ImageView& source, int factor, ReducedFrame& out);

}  // namespace endosdk
