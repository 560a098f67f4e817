// Where both views show the scene, in rows at the width of the output maps: in their fields of view, and under no overlay.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "images/resize.hpp"
#include "maps/field_of_view.hpp"
#include "maps/matched_views.hpp"
#include "maps/overlays.hpp"

namespace endosdk {

// Keeps its tables between frames: nothing is allocated as long as sizes and the number of workers do not grow.
class FieldRows {
 public:
  // Must be called for every frame. `scale` is in cells of the fields per output pixel.
  void prepare(const MatchedViews& views, const Overlays& overlays, int out_width, Scale scale, int workers);

  // 1 for pixels where the left view shows the scene, 0 for others; null if it does everywhere. Half a cell along the edge of a
  // field is outside, because a cell there shows both sides. The row is valid until the worker's next call.
  const uint8_t* left(int y, int worker);

  // The same for the right view. Pixels that are 0 in `valid` are outside, too. A null `valid` excludes no pixel.
  const uint8_t* right(int y, int worker, const uint8_t* valid);

 private:
  struct Side {
    explicit Side(int of) : view(of) {}

    int view;
    const FieldOfView* field = nullptr;
    std::vector<int> first;  // for each cell, the first output pixel whose cells begin there or later
    std::vector<int> end;    // for each cell, one past the last output pixel whose cells end there or earlier
    std::vector<uint8_t> rows;  // per worker
  };

  const uint8_t* row(Side& side, int y, int worker);
  void write_field(const Side& side, int y, uint8_t* inside) const;
  void leave_out(const uint8_t* covered, int cells, uint8_t* inside) const;

  int width_ = 0;
  Scale scale_;
  const Overlays* overlays_ = nullptr;
  Side left_{0};
  Side right_{1};
};

}  // namespace endosdk
