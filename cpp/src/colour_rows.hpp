// Rows of the network's left view at the width of the output maps: nearest pixel, since glare must not be blurred away.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "image.hpp"
#include "resize.hpp"

namespace endosdk {

// Keeps its tables between frames: nothing is allocated as long as sizes and the number of workers do not grow.
class ColourRows {
 public:
  // `scale` counts pixels of the view per output pixel.
  void prepare(const PlanarView& view, int out_width, Scale scale, int workers);

  // The three planes of output row y. They belong to the view, or to this object until the worker's next call.
  std::array<const uint8_t*, 3> row(const PlanarView& view, int y, int worker);

 private:
  std::vector<int32_t> columns_;  // source column of each output column; empty when the two are the same
  std::vector<uint8_t> rows_;     // per worker: three rows
  Scale scale_;
  int out_width_ = 0;
};

}  // namespace endosdk
