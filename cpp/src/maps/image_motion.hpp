// Where the surfaces of a view were in the view before: one shift per patch, by Lucas and Kanade's method over a pyramid.
#pragma once

#include <array>
#include <vector>

#include "images/image.hpp"
#include "images/resize.hpp"
#include "images/size.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {

// The value of a map at a position between its cells, bilinear; outside it the nearest edge's.
float sample_bilinear(const FloatView& map, float x, float y);

// One level of a view's brightness. Its memory is kept between frames.
struct BrightnessMap {
  Size size;
  std::vector<float> values;

  void resize(Size to) {
    size = to;
    values.resize(static_cast<size_t>(to.width) * static_cast<size_t>(to.height));
  }
  FloatView view() const { return {values.data(), size.width, size.height}; }
};

// Means over squares of `unit` pixels of one channel of a view; `out` has its size.
void read_means(const PlanarView& view, int channel, int unit, BrightnessMap& out);

// A view reduced to about 120 columns, and halved again twice while patches still fit.
class BrightnessPyramid {
 public:
  static constexpr int columns = 120;  // about
  static constexpr int most_levels = 3;

  // `picture` is the part of the view that is no padding. Brightness is that of green.
  void read(const PlanarView& view, Size picture);

  int levels() const { return levels_; }
  const BrightnessMap& level(int i) const { return maps_[i]; }

  // Pixels of the view per pixel of level 0.
  int unit() const { return unit_; }

 private:
  std::array<BrightnessMap, most_levels> maps_;
  int levels_ = 0;
  int unit_ = 1;
};

class ImageMotion {
 public:
  static constexpr int patch = motion_patch;  // pixels of a level
  static constexpr int step = 4;   // from a patch to the next

  // Both pyramids are of views of one size. `finest` is the last level that is looked at, in whose pixels shifts are.
  void find(const BrightnessPyramid& now, const BrightnessPyramid& before, int finest = 0);

  // What is at (x, y) of the finest level now was at (x + shift.x, y + shift.y).
  struct Shift {
    float x, y;
  };
  Shift at(float x, float y) const;

  // That of the patch nearest to a pixel, or of one so many patches from it.
  Shift of_patch(int x, int y, int patches_x, int patches_y) const;

  // The median over all patches.
  Shift middle();

 private:
  void refine(const FloatView& now, const FloatView& before);
  void start(Size patches, bool coarsest);
  void smooth();

  Size patches_;
  std::vector<float> x_, y_;                // per patch
  std::vector<float> former_x_, former_y_;  // of the coarser level, and before smoothing
};

}  // namespace endosdk
