// Disparity made steady in time: each frame's is drawn towards that of the frame before, moved to where its surfaces are
// now.
//
// What was there before counts only where the pictures say that it is the same surface, so that nothing trails behind a tool that
// moves. How much it counts follows from the variances of both, which the network's confidence tells. Changes that surfaces make
// are followed, so that nothing lags behind.
#pragma once

#include <vector>

#include "maps/disparity_change.hpp"
#include "maps/frame_match.hpp"

namespace endosdk {

struct TemporalInput {
  PlanarView left;            // as the network saw it
  Size picture;               // the part of it that is no padding
  MutableFloatView disparity;  // network pixels; filtered in place
  FloatView confidence;        // of the same size
  Scale cells;                 // cells of the disparity per pixel of the view
};

// Of one camera, frame after frame. Keeps its memory: nothing is allocated after the second frame of a size.
class TemporalFilter {
 public:
  // A first frame, and one of another size, is left as it is.
  void smooth(const TemporalInput& input);

 private:
  void read_errors(const TemporalInput& input);
  void move_former(const TemporalInput& input, Scale scale);
  void blend(const TemporalInput& input);

  FrameMatch match_;
  DisparityChange change_;
  std::vector<float> former_;  // disparity of the frame before, as it came out
  Size former_size_;
  std::vector<float> moved_;     // the same where its surfaces are now
  std::vector<float> gate_;      // how far the pictures agree there
  std::vector<float> error_;     // to be expected of the frame's own
  std::vector<float> variance_;  // of what came out
  std::vector<float> moved_variance_;
};

}  // namespace endosdk
