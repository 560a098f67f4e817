// Overlays: what a program has drawn into both frames, such as text, a menu or an inset. The pixels there show no scene.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "images/equal_blocks.hpp"
#include "maps/matched_views.hpp"

namespace endosdk {

// For each cell of the left and of the right view, the block of the raw frame that it shows, row by row; -1: none.
struct BlocksOfCells {
  std::vector<int32_t> of[2];
};

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class Overlays {
 public:
  // The fields of view must be those of the same pair. `raw` without blocks: there are no overlays.
  void find(const EqualBlocks& raw, const BlocksOfCells& blocks, const MatchedViews& views);

  void clear() { any_ = false; }

  // 1 for cells of a view that an overlay covers, 0 for others; null if there is no overlay.
  const uint8_t* row(int view, int y) const { return any_ ? covered_[view].data() + static_cast<ptrdiff_t>(y) * cells_.width : nullptr; }

  // Share of all cells of the left view that are covered, and lie in its field of view.
  double share() const { return any_ ? share_ : 0.0; }

 private:
  void mark_surroundings(const BlocksOfCells& blocks, const MatchedViews& views);
  void keep_neighbours(const std::vector<uint8_t>& marks);
  void grow(const std::vector<uint8_t>& marks);
  void widen();
  void cover_cells(const BlocksOfCells& blocks, const MatchedViews& views);

  // Calls visit(index) for a block and those around it.
  template <typename Visit>
  void for_around(int32_t block, Visit visit) const;

  bool any_ = false;
  double share_ = 0.0;
  Size blocks_;
  Size cells_;
  std::vector<uint8_t> surroundings_;  // blocks that the optics do not fill
  std::vector<uint8_t> found_;         // blocks of overlays
  std::vector<int32_t> open_;          // blocks of overlays whose neighbours were not looked at
  std::vector<uint8_t> covered_[2];
};

}  // namespace endosdk
