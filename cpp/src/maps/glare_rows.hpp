// The least of the three channels of the network's left view, in rows at the width of the output maps. Each output pixel takes
// the nearest pixel of the view, because interpolation would blur small glare away.
#pragma once

#include <cstdint>
#include <vector>

#include "images/image.hpp"
#include "images/resize.hpp"

namespace endosdk {

// Keeps its tables between frames: nothing is allocated as long as sizes and the number of workers do not grow.
class GlareRows {
 public:
  // Must be called for every frame. `scale` is in pixels of the view per output pixel.
  void prepare(const PlanarView& view, int out_width, Scale scale, int workers);

  // The least of the three channels for each pixel of output row y, or null if no pixel is saturated. The row is valid until
  // the worker's next call.
  const uint8_t* row(const PlanarView& view, int y, int worker);

 private:
  // The row of the view that is in a worker's memory; -1: none.
  struct Latest {
    int y;
    bool saturated;
  };

  std::vector<int32_t> columns_;  // source column of each output column; empty if both are the same
  std::vector<uint8_t> rows_;     // per worker: one row of the view, one of the output
  std::vector<Latest> latest_;    // per worker
  Scale scale_;
  int out_width_ = 0;
};

}  // namespace endosdk
