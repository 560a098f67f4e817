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
  // To be called for every frame. `scale` counts cells of the fields per output pixel.
  void prepare(const FieldOfView& left, const FieldOfView& right, int out_width, Scale scale, int workers);

  // 1 for pixels inside the left field, 0 for others; null where all are inside. Half a cell along the edge is outside,
  // because there a cell shows both. Good until the worker's next call.
  const uint8_t* left(int y, int worker);

  // The same of the right field; pixels that are not in `valid` (null: all are) are not inside either.
  const uint8_t* right(int y, int worker, const uint8_t* valid);

 private:
  struct Side {
    const FieldOfView* field = nullptr;
    std::vector<int> first;  // output pixel, of those whose cells begin at each cell or after it
    std::vector<int> end;    // after the last one of those whose cells end at each cell or before it
    std::vector<uint8_t> rows;  // per worker
  };

  const uint8_t* row(Side& side, int y, int worker);

  int width_ = 0;
  Scale scale_;
  Side left_;
  Side right_;
};

}  // namespace endosdk
