// What each view of a pair tells by itself and beside the other: light, glare, cover and blur.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "maps/matched_views.hpp"

namespace endosdk {

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class ViewMeasures {
 public:
  // `picture_width` is that of the views without their padding, px.
  void measure(const MatchedViews& views, int picture_width);

  // Mean grey level of the darker view, in its field of view.
  double level() const { return level_; }

  // Share of the cells of a field of view that are blown out; of the view with more.
  double saturated() const { return saturated_; }

  // Share of the tiles with texture in one view that are flat in the other one; of the view with more. Not a number where
  // there is too little to say so.
  double covered() const { return covered_; }

  // Standard deviation of the Gaussian by which the sharper view must be blurred to be as soft as the other one,
  // thousandths of the width. Not a number where there is too little texture.
  double blur() const { return blur_; }

 private:
  // Every so many rows of brightness of one view, as far as they are well inside its field of view.
  struct Rows {
    std::vector<float> values;
    std::vector<int> counts;  // of each row
  };

  void find_light(const MatchedViews& views, int view);
  void find_tiles(const MatchedViews& views, int view);
  double covered_of(int flat_view) const;
  void read_rows(const MatchedViews& views, int view);
  void blur_rows(const MatchedViews& views, int view);
  double sharpness(const MatchedViews& views, int view, int passes);
  double find_blur(const MatchedViews& views, int picture_width);

  Size tiles_;
  std::vector<uint8_t> textures_[2];  // of tiles: see Texture
  std::vector<float> roughness_[2];  // of one row of tiles
  Rows rows_[2];
  std::vector<float> sums_[2];  // two rows of brightness each
  double levels_[2] = {};  // mean grey level, and share that is blown out, of each view
  double shares_[2] = {};
  double level_ = 0.0;
  double saturated_ = 0.0;
  double covered_ = 0.0;
  double blur_ = 0.0;
};

}  // namespace endosdk
