// Where each pixel's surface was in the frame before, and whether the pictures agree that it is the same one: photometric
// consistency of the left view now and before.
#pragma once

#include <vector>

#include "maps/image_motion.hpp"

namespace endosdk {

// Of one camera, frame after frame. Both frames are reduced, see BrightnessPyramid.
class FrameMatch {
 public:
  // Takes the next frame; `picture` is the part of it that is no padding. False where nothing can be compared: a first frame,
  // one of another size, or one smaller than a patch.
  bool next(const PlanarView& left, Size picture);

  Size size() const { return views_[now_].level(0).size; }
  // Pixels of the view per reduced one.
  int unit() const { return views_[now_].unit(); }

  // Per reduced pixel: what is there now was a shift away; and how far the pictures agree, 0..1.
  const std::vector<ImageMotion::Shift>& shifts() const { return shifts_; }
  const std::vector<float>& agreement() const { return agreement_; }

 private:
  // Of the exposure, from the frame before to this one.
  struct Gains {
    float green = 1.0f, red = 1.0f;
  };

  void compare();
  // Of each pixel moved by its own motion: what it differs by, before any smoothing.
  Gains read_residuals();
  void smooth_residuals();
  // What both colours differ by from the frame before around a pixel whose surface was at a shift from there.
  float difference_at(int x, int y, ImageMotion::Shift shift, const Gains& gains) const;
  float find_better(int x, int y, const Gains& gains, float residual);

  int now_ = 0;  // which of the two pyramids is this frame's
  BrightnessPyramid views_[2];
  BrightnessMap red_[2];  // as the finest level of the pyramids, which are green: steel and tissue may be as bright in one
  ImageMotion motion_;
  std::vector<ImageMotion::Shift> shifts_;
  std::vector<float> agreement_;
  std::vector<float> residual_;
  std::vector<float> moved_red_;
  std::vector<float> sorted_;
};

}  // namespace endosdk
