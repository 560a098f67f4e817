// Why two views do not agree: patches of the left view are looked for in the right one without the network, to both sides
// and on other rows. It takes longer than other checks, and is asked only of frames that failed them, or whose matches tell
// of no rotation.
#pragma once

#include <array>
#include <vector>

#include "kernels/kernels.hpp"
#include "maps/matched_views.hpp"

namespace endosdk {

class CoarseMatch {
 public:
  void measure(const MatchedViews& views);

  // How much better patches correlate with the right view to their right, where matches of exchanged views lie, than to
  // their left; not a number where there is too little texture.
  double exchanged_gain() const { return exchanged_gain_; }

  // Rows of brightness by which matches lie lower, where all patches together correlate clearly better on those rows than on
  // others; not a number where they do not.
  double rows_off() const { return rows_off_; }

 private:
  static constexpr int farthest_row = 10;
  static constexpr int rows_tried = 2 * farthest_row + 1;
  using Likeness = std::array<double, rows_tried>;  // of one patch, on each row

  void find_spread(const MatchedViews& views);
  bool read_patch(const MatchedViews& views, int x, int y);
  void correlate(const MatchedViews& views, int x, int y, int count);
  double find_rows(size_t patches) const;

  double exchanged_gain_ = 0.0;
  double rows_off_ = 0.0;
  std::array<float, patch_cells> patch_;  // about its mean
  float deviation_ = 0.0f;                // root of the sum of its squares
  std::vector<float> spread_;  // of a patch around each cell of the right view: one over the root of its sum of squares; 0: flat
  std::vector<float> columns_;
  std::vector<float> found_;
  std::vector<Likeness> likeness_;
};

}  // namespace endosdk
