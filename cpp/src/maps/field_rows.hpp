// The fields of view of both views, in rows at the width of the output maps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "images/resize.hpp"
#include "maps/field_of_view.hpp"

namespace endosdk {

// Keeps its tables between frames: nothing is allocated as long as sizes and the number of workers do not grow.
class FieldRows {
 public:
  // Must be called for every frame. `scale` is in cells of the fields per output pixel.
  void prepare(const FieldOfView& left, const FieldOfView& right, int out_width, Scale scale, int workers);

  // 1 for pixels inside the left field, 0 for others; null if all are inside. Half a cell along the edge is outside, because a
  // cell there shows both sides. The row is valid until the worker's next call.
  const uint8_t* left(int y, int worker);

  // The same for the right field. Pixels that are 0 in `valid` are outside, too. A null `valid` excludes no pixel.
  const uint8_t* right(int y, int worker, const uint8_t* valid);

 private:
  struct Side {
    const FieldOfView* field = nullptr;
    std::vector<int> first;  // for each cell, the first output pixel whose cells begin there or later
    std::vector<int> end;    // for each cell, one past the last output pixel whose cells end there or earlier
    std::vector<uint8_t> rows;  // per worker
  };

  const uint8_t* row(Side& side, int y, int worker);

  int width_ = 0;
  Scale scale_;
  Side left_;
  Side right_;
};

}  // namespace endosdk
