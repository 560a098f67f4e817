// Why two views do not agree: patches of the left view are looked for in the right one without the network, to both sides
// and on other rows. It takes longer than other checks, and is asked of frames that failed them alone.
#pragma once

#include "maps/matched_views.hpp"

namespace endosdk {

class CoarseMatch {
 public:
  void measure(const MatchedViews& views);

  // How much better patches correlate with the right view to their right, where matches of exchanged views lie, than to
  // their left; not a number where there is too little texture.
  double exchanged_gain() const { return exchanged_gain_; }

  // Rows of brightness by which matches lie lower, over the patches that correlate much better there than on their own row;
  // not a number where few do, or where they do not agree.
  double rows_off() const { return rows_off_; }

 private:
  struct Best {
    float correlation = -1.0f;
    int rows = 0;
  };
  Best best_of(int x, int y, int direction, int nearest, int farthest_row) const;

  const MatchedViews* views_ = nullptr;
  double exchanged_gain_ = 0.0;
  double rows_off_ = 0.0;
};

}  // namespace endosdk
