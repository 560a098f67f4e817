// Parts of a picture in which matches lie off their rows although the rig does not explain it: liquid on a lens bends the
// picture there, or one view shows another moment there. Matches are then wrong along the rows, too, and nothing else tells.
#pragma once

#include <vector>

#include "images/resize.hpp"
#include "images/size.hpp"

namespace endosdk {

// Share of the parts from which a frame is called distorted. Clean pairs, rendered and real, reach 0.033; of a hundred pairs of
// surgery with noise, little light and the like, one reaches 0.056 (`fast-320`).
constexpr double distorted_share = 0.04;

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

  // Share of the parts that do not fit, where a part without such a neighbour counts half; NaN before the first find().
  double share() const { return share_; }

  // One value for each part: 0 for those that fit worst and for their neighbours, else 1. Empty if the frame is not distorted.
  FloatView kept() const;

 private:
  // How far the matches of a part lie off their rows; 0 up to `least`, and where too few were measured or they do not agree.
  float misfit_of(const std::vector<float>& rest, int row, int column, float least);

  // Number of parts that fit worse than `least`: this one and its neighbours.
  int parts_around(int row, int column, float least) const;

  int along_ = 0;
  int across_ = 0;  // parts
  int down_ = 0;
  double share_ = 0.0;
  std::vector<float> found_;  // the misfit of each part
  std::vector<float> kept_;
  std::vector<float> values_;  // of one part
};

}  // namespace endosdk
