// Where the surface at each pixel was in the previous frame, and whether the pictures agree that it is the same surface. This
// is photometric consistency between the left views of two frames.
#pragma once

#include <vector>

#include "maps/image_motion.hpp"

namespace endosdk {

// Matches the frames of one camera, in their order. Both frames are reduced, see BrightnessPyramid.
class FrameMatch {
 public:
  // Takes the next frame; `picture` is its part without the padding. Returns false if there is nothing to compare: for the
  // first frame, after a change of size, and for a frame smaller than a patch.
  bool next(const PlanarView& left, Size picture);

  Size size() const { return views_[now_].level(0).size; }
  // Pixels of the view per reduced one.
  int unit() const { return views_[now_].unit(); }

  // For each reduced pixel: the shift from where its surface is now to where it was, and how well the pictures agree, 0..1.
  const std::vector<ImageMotion::Shift>& shifts() const { return shifts_; }
  const std::vector<float>& agreement() const { return agreement_; }

 private:
  // Factors of the exposure, from the previous frame to this one.
  struct Gains {
    float green = 1.0f, red = 1.0f;
  };

  void compare();
  // Writes the difference of each pixel, moved by its own motion, before any smoothing.
  Gains read_residuals();
  void smooth_residuals();
  // Difference from the previous frame, over both colours, around pixel (x, y), for a surface that was `shift` away.
  float difference_at(int x, int y, ImageMotion::Shift shift, const Gains& gains) const;
  float find_better(int x, int y, const Gains& gains, float residual);

  int now_ = 0;  // index of this frame's pyramid
  BrightnessPyramid views_[2];
  BrightnessMap red_[2];  // red, beside the pyramids' green: steel and tissue may be equally bright in one colour
  ImageMotion motion_;
  std::vector<ImageMotion::Shift> shifts_;
  std::vector<float> agreement_;
  std::vector<float> residual_;
  std::vector<float> moved_red_;
  std::vector<float> sorted_;
};

}  // namespace endosdk
