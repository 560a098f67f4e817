// One camera of a rig: its lens model, projection and the inverse.
#pragma once

#include <array>
#include <limits>

#include "geometry/linear.hpp"

namespace endosdk {

enum class CameraModel { pinhole, fisheye };

struct Point {
  double x = 0.0;
  double y = 0.0;
};

constexpr Point nowhere = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};

// Intrinsics in pixels, and distortion in OpenCV's order: pinhole k1 k2 p1 p2 k3 k4 k5 k6, fisheye k1 k2 k3 k4. Coefficients
// that a calibration does not have are zero.
struct Camera {
  CameraModel model = CameraModel::pinhole;
  double fx = 1.0;
  double fy = 1.0;
  double cx = 0.0;
  double cy = 0.0;
  std::array<double, 8> distortion{};
};

// Throws unless the focal lengths are positive and all numbers are finite.
void check_camera(const Camera& camera, const char* name);

// The pixel of the raw image at which the ray through (x, y, 1) arrives.
Point project(const Camera& camera, Point normalised);

// The ray of a raw pixel. It takes the same number of iterations as OpenCV, so that rectification agrees with OpenCV.
Point unproject(const Camera& camera, Point pixel);

// The largest radius, on the plane at unit distance, up to which the lens model is one-to-one. Beyond it the polynomial folds
// back and shows parts of the image again. Infinity if it never folds back.
double fold_radius(const Camera& camera);

}  // namespace endosdk
