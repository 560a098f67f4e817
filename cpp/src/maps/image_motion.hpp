// Where the surfaces of a view were in the previous view: one shift per patch, by the Lucas-Kanade method over a pyramid.
#pragma once

#include <array>
#include <vector>

#include "images/image.hpp"
#include "images/resize.hpp"
#include "images/size.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {

// Bilinear sample of a map. A position outside the map takes the value of the nearest edge.
float sample_bilinear(const FloatView& map, float x, float y);

// One level of a view's brightness. It keeps its memory between frames.
struct BrightnessMap {
  Size size;
  std::vector<float> values;

  void resize(Size to) {
    size = to;
    values.resize(static_cast<size_t>(to.width) * static_cast<size_t>(to.height));
  }
  FloatView view() const { return {values.data(), size.width, size.height}; }
};

// Writes means over squares of unit x unit pixels of one channel of a view. The size of `out` sets how many.
void read_means(const PlanarView& view, int channel, int unit, BrightnessMap& out);

// A view reduced to about 120 columns, then halved up to two times while patches still fit.
class BrightnessPyramid {
 public:
  static constexpr int columns = 120;  // about
  static constexpr int most_levels = 3;

  // `picture` is the part of the view without the padding. Brightness is the green channel.
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
  static constexpr int step = 4;   // pixels from one patch to the next

  // Both views have the same size. `finest` is the last level that is searched; shifts are in pixels of this level.
  void find(const BrightnessPyramid& now, const BrightnessPyramid& before, int finest = 0);

  // The surface that is now at (x, y) of the finest level was at (x + shift.x, y + shift.y).
  struct Shift {
    float x, y;
  };
  Shift at(float x, float y) const;

  // The shift of the patch nearest to pixel (x, y), or of the patch patches_x and patches_y away from it.
  Shift of_patch(int x, int y, int patches_x, int patches_y) const;

  // The median over all patches.
  Shift middle();

  // The median shift away from the middle of the picture.
  float outwards();

 private:
  void refine(const FloatView& now, const FloatView& before);
  void start(Size patches, bool coarsest);
  void smooth();

  Size patches_;
  std::vector<float> x_, y_;                // per patch
  std::vector<float> former_x_, former_y_;  // shifts of the coarser level; during smoothing, shifts before it
};

}  // namespace endosdk
