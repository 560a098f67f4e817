// Whether the two views show the same surface where the network matched them.
//
// A network answers whatever it is shown, and is sure of itself even when one camera is covered or the views are of
// different moments. The pictures themselves tell: in blocks that were matched rightly, the left view and the right view
// at the disparity found rise and fall together.
#pragma once

#include <cstdint>
#include <vector>

#include "images/image.hpp"
#include "images/resize.hpp"
#include "images/size.hpp"

namespace endosdk {

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class PhotometricConsistency {
 public:
  static constexpr int blocks_per_width = 30;
  static constexpr int smallest_block = 16;    // px; fewer pixels do not tell noise from consistency
  static constexpr double weakest = 0.2;       // correlation from which a block supports its answers
  static constexpr double strong = 0.5;        // correlation of a block that speaks for the whole pair
  static constexpr int strong_is_one_in = 3;   // with fewer strong blocks the views do not belong together

  // The network's confidence, but 0 in blocks without support, and everywhere when the views do not belong together.
  // `picture` is the part of both views that is no padding; `cells` counts grid cells per pixel of the views. Views of
  // the same frame never belong together: one camera was connected twice. The view that is returned is good until the
  // next call.
  FloatView supported(const FloatView& disparity, const FloatView& confidence, const PlanarView& left,
                      const PlanarView& right, Size picture, Scale cells, bool same_frames);

  // Of the latest pair.
  bool views_belong_together() const { return belong_together_; }

 private:
  enum class Verdict : uint8_t { not_judged, flat, weak, fair, strong };

  // Over samples. Whole numbers, so that every machine comes to the same verdict.
  struct Sums {
    int64_t count = 0;
    int64_t left = 0;
    int64_t right = 0;
    int64_t left_left = 0;
    int64_t right_right = 0;
    int64_t left_right = 0;
  };

  // The sums of each column of samples in a row of blocks, so that rows are added up side by side.
  struct Columns {
    std::vector<int16_t> matched, here, there;  // of one row of samples; 0 where there is no match
    std::vector<int32_t> count, left, right, left_left, right_right, left_right;

    void resize(size_t samples);
    void clear();
    void add_row();
    Sums sum(size_t begin, size_t end) const;
  };

  void judge_row(int row, int worker, const FloatView& disparity, const PlanarView& left, const PlanarView& right,
                 Scale cells);
  Verdict judge(const Sums& sums) const;
  FloatView without_unsupported(const FloatView& confidence, Scale cells);

  Size picture_;
  int block_ = 0;   // side of a block, px
  Size blocks_;     // how many
  std::vector<int32_t> cell_of_sample_;
  std::vector<int32_t> block_of_cell_;
  std::vector<Columns> columns_;  // per worker
  std::vector<Verdict> verdicts_;
  std::vector<float> confidence_;
  bool belong_together_ = true;
};

}  // namespace endosdk
