// A rig, given by its calibration numbers: their checks, the rectified geometry, and the hash that identifies the rig in
// results.
#pragma once

#include <endosdk/endosdk.h>

#include <string>

#include "geometry/stereo_rectify.hpp"
#include "images/rectify.hpp"

namespace endosdk {

// Rectifying rotations and projections, and the size of the rectified pictures.
struct RectifiedGeometry {
  Rectification views;
  Size size;

  double focal_px() const { return views.left_projection[0]; }
  double focal_y_px() const { return views.left_projection[5]; }
  double baseline_mm() const { return -views.right_projection[3] / views.right_projection[0]; }
  double cx() const { return views.left_projection[2]; }
  double cy() const { return views.left_projection[6]; }
  double doffs() const { return views.right_projection[2] - views.left_projection[2]; }

  // The same view resampled to another size.
  RectifiedGeometry scaled(Size target) const;
};

// Whether pictures of a rig need no rectification: no distortion, parallel axes, equal rows and focal length.
bool stands_rectified(const endo_calibration& rig);

// One checked rig. The rules are those of the Python package, so that both accept the same numbers.
class Rig {
 public:
  explicit Rig(const endo_calibration& numbers);

  // A rig of rectified frames, for use when only the size of the frames changes.
  static Rig identity(Size size);

  Size size() const { return {numbers_.width, numbers_.height}; }
  bool is_rectified() const { return is_rectified_; }
  const RectifiedGeometry& geometry() const { return geometry_; }

  // The geometry for another alpha than the 0 of the frame path. A rectified rig has only one geometry.
  RectifiedGeometry geometry(double alpha) const;

  // The field of view in the raw frame: centre x, y and half axes x, y, px. Null if it is not stated.
  const double* field_of_view(bool right) const;

  // One camera, and the geometry of its rectified view.
  ViewGeometry view(bool right, const RectifiedGeometry& target) const;

  // Equal to the Python package's StereoCalibration.sha256.
  const std::string& sha256() const { return sha256_; }

  // Maps from raw frames to rectified pictures of the given geometry.
  Rectifier rectifier(const RectifiedGeometry& target, Border border) const;

 private:
  endo_calibration numbers_;
  bool is_rectified_;
  RectifiedGeometry geometry_;
  std::string sha256_;
};

}  // namespace endosdk
