// Finds out why two views do not agree. It searches patches of the left view in the right view, on both sides and on other
// rows. The search takes longer than other checks. It runs only for frames that failed those checks, or for which no rotation of
// the rig could be measured.
#pragma once

#include <array>
#include <vector>

#include "maps/patch_search.hpp"

namespace endosdk {

class CoarseMatch {
 public:
  // `search` has taken the views.
  void measure(PatchSearch& search, const MatchedViews& views);

  // How much better patches correlate with the right view on their right, where matches of swapped views lie, than on their
  // left. NaN where there is too little texture.
  double exchanged_gain() const { return exchanged_gain_; }

  // Rows of brightness by which matches lie lower in the right view. NaN unless all patches together correlate clearly better
  // at this offset than at others.
  double rows_off() const { return rows_off_; }

 private:
  static constexpr int farthest_row = 10;
  static constexpr int rows_tried = 2 * farthest_row + 1;
  using Likeness = std::array<double, rows_tried>;  // how well one patch correlates on each row

  double find_rows(size_t patches) const;

  double exchanged_gain_ = 0.0;
  double rows_off_ = 0.0;
  std::vector<Likeness> likeness_;
};

}  // namespace endosdk
