// Measures of each view, alone and compared with the other view: light, glare, covered lens and blur.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "maps/matched_views.hpp"

namespace endosdk {

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class ViewMeasures {
 public:
  // `picture_width` is the width of the views without their padding, px.
  void measure(const MatchedViews& views, int picture_width);

  // Mean grey level of the darker view, in its field of view.
  double level() const { return level_; }

  // Share of the cells in the field of view that are overexposed, for the view with more of them.
  double saturated() const { return saturated_; }

  // Share of the tiles with texture in one view whose match in the other view is flat, for the view with more of them. NaN where
  // there are too few tiles with texture.
  double covered() const { return covered_; }

  // Share of the tiles in the field of view that have texture beyond noise and even shading, for the view with more of them. NaN
  // where there are too few tiles.
  double textured() const { return textured_; }

  // Standard deviation of the Gaussian that blurs the sharper view until it is as soft as the other one, in thousandths of the
  // width. NaN where there is too little texture.
  double blur() const { return blur_; }

 private:
  // Some rows of brightness of one view, at regular distances, each cut to the columns well inside the field of view.
  struct Rows {
    std::vector<float> values;
    std::vector<int> counts;  // columns of each row
  };

  void find_light(const MatchedViews& views, int view);
  void find_tiles(const MatchedViews& views, int view);
  bool flat_around(int view, int x, int y) const;  // a tile and those beside it
  double find_covered(const MatchedViews& views) const;
  double textured_of(int view) const;
  void read_rows(const MatchedViews& views, int view);
  void blur_rows(const MatchedViews& views, int view);
  double sharpness(const MatchedViews& views, int view, int passes);
  double find_blur(const MatchedViews& views, int picture_width);

  Size tiles_;
  std::vector<uint8_t> textures_[2];  // a `Texture` for each tile
  std::vector<float> roughness_[2];  // one row of tiles
  Rows rows_[2];
  std::vector<float> sums_[2];  // two rows of brightness each
  double levels_[2] = {};  // mean grey level of each view; `shares_`: its overexposed share
  double shares_[2] = {};
  double level_ = 0.0;
  double saturated_ = 0.0;
  double covered_ = 0.0;
  double textured_ = 0.0;
  double blur_ = 0.0;
};

}  // namespace endosdk
