// How bright the network's left view is at least, over its channels, in rows at the width of the output maps: nearest
// pixel, since glare must not be blurred away.
#pragma once

#include <cstdint>
#include <vector>

#include "images/image.hpp"
#include "images/resize.hpp"

namespace endosdk {

// Keeps its tables between frames: nothing is allocated as long as sizes and the number of workers do not grow.
class GlareRows {
 public:
  // To be called for every frame. `scale` counts pixels of the view per output pixel.
  void prepare(const PlanarView& view, int out_width, Scale scale, int workers);

  // The least of the three channels for each pixel of output row y, or null when none of them is saturated; good until
  // the worker's next call.
  const uint8_t* row(const PlanarView& view, int y, int worker);

 private:
  // The row of the view that a worker's rows hold; -1: none.
  struct Latest {
    int y;
    bool saturated;
  };

  std::vector<int32_t> columns_;  // source column of each output column; empty when the two are the same
  std::vector<uint8_t> rows_;     // per worker: one row of the view, one of the output
  std::vector<Latest> latest_;    // per worker
  Scale scale_;
  int out_width_ = 0;
};

}  // namespace endosdk
