// Temporal filter: makes the disparity steadier over time.
//
// The filter takes the disparity of the previous frame, moves it to where its surfaces are now, and pulls the disparity of the
// current frame towards it. The previous disparity counts only where the pictures agree that it is the same surface. So a tool
// that moves leaves no trail. The variances of both disparities, which follow from the network's confidence, set how much it
// counts. The filter follows the changes of depth of surfaces, so the result does not lag.
#pragma once

#include <vector>

#include "maps/disparity_change.hpp"
#include "maps/frame_match.hpp"

namespace endosdk {

struct TemporalInput {
  PlanarView left;            // as the network saw it
  Size picture;               // the part of `left` without the padding
  MutableFloatView disparity;  // network pixels; filtered in place
  FloatView confidence;        // has the same size
  Scale cells;                 // cells of the disparity per pixel of the view
};

// The filter of one camera. It takes every frame in order. It keeps its memory: after the second frame of a size it allocates
// nothing.
class TemporalFilter {
 public:
  // Leaves the first frame as it is, and the first one after a change of size.
  void smooth(const TemporalInput& input);

 private:
  void read_errors(const TemporalInput& input);
  void move_former(const TemporalInput& input, Scale scale);
  void blend(const TemporalInput& input);

  FrameMatch match_;
  DisparityChange change_;
  std::vector<float> former_;  // filtered disparity of the previous frame
  Size former_size_;
  std::vector<float> moved_;     // `former_`, moved to where its surfaces are now
  std::vector<float> gate_;      // how well the pictures agree at each cell, 0..1
  std::vector<float> error_;     // expected error of the unfiltered disparity
  std::vector<float> variance_;  // variance of the filtered disparity
  std::vector<float> moved_variance_;
};

}  // namespace endosdk
