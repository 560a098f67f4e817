// Between raw and rectified pixels, rectified and raw cameras; OpenCV's Q and the region that both views cover.
#pragma once

#include <array>

#include "geometry/rig.hpp"

namespace endosdk {

enum class Side { left, right };

// A rig rectified with one alpha, as in stereo_rectify; a rectified rig stays as it is.
class PixelMap {
 public:
  PixelMap(const Rig& rig, double alpha);

  const RectifiedGeometry& geometry() const { return geometry_; }

  // Of one view, both ways; not a number for rays that point backwards, or where the lens model folds.
  Point to_raw(Side side, Point rectified) const;
  Point to_rectified(Side side, Point raw) const;

  // A point of the rectified left camera's frame in that of the raw left camera, which a hand-eye calibration knows.
  Vec3 to_raw_left(const Vec3& point) const;

  // Q (x, y, disparity, 1) is the point, homogeneous, mm; row by row. NaN where pixels are not square: Q cannot say that.
  std::array<double, 16> q() const;

  // x, y, width and height of the largest rectangle of pixels for which both rectified views have a source.
  std::array<int, 4> region() const;

 private:
  static size_t index(Side side) { return side == Side::right ? 1 : 0; }

  RectifiedGeometry geometry_;
  bool rectifies_;
  Size raw_;
  std::array<ViewGeometry, 2> views_;
  std::array<SourceMap, 2> sources_;
};

}  // namespace endosdk
