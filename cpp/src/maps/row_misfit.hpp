// Parts of a picture in which matches lie off their rows although the rig does not explain it: liquid on a lens bends the
// picture there, or one view shows another moment there. Matches are then wrong along the rows, too, and nothing else tells.
#pragma once

#include <vector>

#include "images/resize.hpp"
#include "images/size.hpp"

namespace endosdk {

// Share of the parts from which a frame is called distorted. Clean pairs, rendered and real, reach 0.033.
constexpr double distorted_share = 0.05;

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class RowMisfit {
 public:
  // A part has so many bands of measurements, and so many measurements of each.
  static constexpr int part_bands = 3;
  static constexpr int part_along = 12;

  void prepare(int bands, int along);

  // The vertical disparity that the rig leaves, `along` values for each band, NaN where nothing was measured. `least` is that of
  // a part that counts, in the same unit.
  void find(const std::vector<float>& rest, float least);

  Size parts() const { return {across_, down_}; }

  // Share of the parts that do not fit; NaN before the first find().
  double share() const { return share_; }

  // One value for each part: 0 for those that do not fit and for their neighbours, else 1. Empty if the frame is not distorted.
  FloatView kept() const;

 private:
  bool misfits(const std::vector<float>& rest, int row, int column, float least);

  int along_ = 0;
  int across_ = 0;  // parts
  int down_ = 0;
  double share_ = 0.0;
  std::vector<char> found_;
  std::vector<float> kept_;
  std::vector<float> values_;  // of one part
};

}  // namespace endosdk
