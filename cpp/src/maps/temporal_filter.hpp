// Disparity made steady in time: each frame's is drawn towards that of the frame before, moved to where its surfaces are
// now.
//
// What was there before counts only where the pictures say that it is the same surface: photometric consistency of the left view
// now and before. So nothing trails behind a tool that moves. How much it counts follows from the variances of both, which the
// network's confidence tells. A change of disparity that a neighbourhood shares is followed, so that nothing lags behind a tool
// that comes nearer.
#pragma once

#include <vector>

#include "maps/image_motion.hpp"

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
  struct BlockSums {
    float weight = 0.0f, difference = 0.0f, error = 0.0f;
  };
  // Of the exposure, from the frame before to this one.
  struct Gains {
    float green = 1.0f, red = 1.0f;
  };

  void read_errors(const TemporalInput& input);
  // How much an earlier disparity may count, by the pictures: 0..1 for each pixel of the reduced view.
  void compare_pictures();
  // What both colours differ by from the frame before around a pixel whose surface was at a shift from there.
  float difference_at(int x, int y, ImageMotion::Shift shift, const Gains& gains) const;
  float find_better(int x, int y, const Gains& gains, float residual);
  void move_former(const TemporalInput& input, Scale scale);
  void follow_depth(const TemporalInput& input);
  void follow_neighbourhoods(const TemporalInput& input);
  BlockSums sums_around(Size blocks, int x, int y) const;
  float median_size(const std::vector<float>& values);
  void blend(const TemporalInput& input);
  void keep(const TemporalInput& input);

  bool has_former_ = false;
  int now_ = 0;  // which of the two pyramids is this frame's
  BrightnessPyramid views_[2];
  BrightnessMap red_[2];  // as the finest level of the pyramids, which are green: steel and tissue may be as bright in one
  ImageMotion motion_;
  std::vector<float> former_;    // disparity of the frame before, as it came out
  Size former_size_;
  std::vector<float> moved_;     // the same where its surfaces are now
  std::vector<float> error_;     // to be expected of the frame's own
  std::vector<float> variance_;  // of what came out
  std::vector<float> moved_variance_;
  std::vector<BlockSums> blocks_;
  std::vector<float> changes_;   // per block
  std::vector<float> limits_;    // of noise, per block
  std::vector<float> gate_;      // per cell
  std::vector<ImageMotion::Shift> shifts_;  // per pixel of the reduced view
  std::vector<float> agreement_;  // per pixel of the reduced view
  std::vector<float> residual_;
  std::vector<float> moved_red_;
  std::vector<float> sorted_;
};

}  // namespace endosdk
