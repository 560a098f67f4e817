// One camera of a rig: its projection, the inverse, and where a rectified pixel comes from.
#pragma once

#include <array>

#include "geometry/linear.hpp"

namespace endosdk {

enum class CameraModel { pinhole, fisheye };

struct Point {
  double x = 0.0;
  double y = 0.0;
};

// Intrinsics in pixels and distortion in OpenCV's order: pinhole k1 k2 p1 p2 k3 k4 k5 k6, fisheye k1 k2 k3 k4;
// coefficients that a calibration leaves out are zero.
struct Camera {
  CameraModel model = CameraModel::pinhole;
  double fx = 1.0;
  double fy = 1.0;
  double cx = 0.0;
  double cy = 0.0;
  std::array<double, 8> distortion{};
};

// Focal lengths positive, everything finite.
void check_camera(const Camera& camera, const char* name);

// Where the ray through (x, y, 1) meets the raw image, in pixels.
Point project(const Camera& camera, Point normalised);

// The ray of a raw pixel, by the same number of iterations as OpenCV makes, so that rectification agrees with it.
Point unproject(const Camera& camera, Point pixel);

// The largest radius, on the plane at unit distance, up to which the lens model keeps the order of points. Beyond it
// the polynomial folds back and shows parts of the image again; infinity when it never does.
double fold_radius(const Camera& camera);

}  // namespace endosdk
