// Searches patches of the left view in the right view, by correlation, without the network.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "kernels/kernels.hpp"
#include "maps/matched_views.hpp"

namespace endosdk {

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class PatchSearch {
 public:
  // A picture has a hundred patches, which overlap.
  static constexpr int across = 10;
  static constexpr int down = 10;
  static constexpr size_t most_patches = size_t{across} * down;
  static constexpr size_t least_patches = 16;  // with fewer, nothing can be said

  // Takes the views of a frame. They must live as long as this frame is searched.
  void take(const MatchedViews& views);

  // Number of cells along a row within which matches are searched: a quarter of the width.
  int longest() const { return cells_.width / 4; }
  // The optical axes of unrectified views may cross. Then matches of far surfaces lie a little on the other side.
  int crossed() const { return cells_.width / 16; }

  // Reads the patch of the left view around cell (x, y). Returns false if it is flat.
  bool read(int x, int y);

  // Correlations of this patch with the right view around `count` cells of row y, from x on. Patches there must lie inside.
  // Valid until the next call.
  const std::vector<float>& correlate(int x, int y, int count);

 private:
  const float* spread_of(int y);

  const MatchedViews* views_ = nullptr;
  Size cells_;
  std::array<float, patch_cells> patch_;  // grey levels less their mean
  float deviation_ = 0.0f;                // root of the sum of squares of `patch_`
  std::vector<float> spread_;  // 1 / root of the sum of squares of the patch around each cell of the right view; 0: flat
  std::vector<uint8_t> known_;  // rows of `spread_` that this frame has computed
  std::vector<float> columns_;
  std::vector<float> found_;
};

}  // namespace endosdk
