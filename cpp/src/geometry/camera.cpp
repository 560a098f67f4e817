#include "geometry/camera.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "platform/errors.hpp"

namespace endosdk {
namespace {

constexpr double half_pi = 1.5707963267948966;

double pinhole_radial(const std::array<double, 8>& k, double r2) {
  const double numerator = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double denominator = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
  return numerator / denominator;
}

Point tangential(const std::array<double, 8>& k, Point p) {
  const double r2 = p.x * p.x + p.y * p.y;
  const double cross = 2.0 * p.x * p.y;
  return {k[2] * cross + k[3] * (r2 + 2.0 * p.x * p.x), k[2] * (r2 + 2.0 * p.y * p.y) + k[3] * cross};
}

double fisheye_angle(const std::array<double, 8>& k, double theta) {
  const double t2 = theta * theta;
  return theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

double fisheye_slope(const std::array<double, 8>& k, double theta) {
  const double t2 = theta * theta;
  return 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
}

Point unproject_pinhole(const Camera& camera, Point distorted) {
  constexpr int iterations = 5;
  Point p = distorted;
  for (int i = 0; i < iterations; ++i) {
    const double factor = pinhole_radial(camera.distortion, p.x * p.x + p.y * p.y);
    if (factor < 0.0) return distorted;
    const Point shift = tangential(camera.distortion, p);
    p = {(distorted.x - shift.x) / factor, (distorted.y - shift.y) / factor};
  }
  return p;
}

Point unproject_fisheye(const Camera& camera, Point distorted) {
  constexpr int iterations = 10;
  constexpr double tolerance = 1e-8;
  const double target = std::min(std::hypot(distorted.x, distorted.y), half_pi);
  if (target <= tolerance) return {0.0, 0.0};
  double theta = target;
  for (int i = 0; i < iterations; ++i) {
    const double step =
        (fisheye_angle(camera.distortion, theta) - target) / fisheye_slope(camera.distortion, theta);
    theta -= step;
    if (std::fabs(step) < tolerance) {
      if (theta < 0.0) break;
      const double factor = std::tan(theta) / target;
      return {distorted.x * factor, distorted.y * factor};
    }
  }
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  return {nothing, nothing};
}

// The distorted radius of a point at undistorted radius r (pinhole) or ray angle r (fisheye).
double distorted_radius(const Camera& camera, double r) {
  if (camera.model == CameraModel::fisheye) return fisheye_angle(camera.distortion, r);
  return r * pinhole_radial(camera.distortion, r * r);
}

}  // namespace

void check_camera(const Camera& camera, const char* name) {
  const std::string matrix = std::string(name) + " matrix";
  for (double value : {camera.fx, camera.fy, camera.cx, camera.cy}) {
    require(std::isfinite(value), matrix, "every value must be finite", value);
  }
  require(camera.fx > 0.0, matrix, "the focal lengths must be positive", camera.fx);
  require(camera.fy > 0.0, matrix, "the focal lengths must be positive", camera.fy);
  for (double value : camera.distortion) {
    require(std::isfinite(value), std::string(name) + " distortion", "every value must be finite", value);
  }
}

Point project(const Camera& camera, Point p) {
  Point distorted;
  if (camera.model == CameraModel::pinhole) {
    const double factor = pinhole_radial(camera.distortion, p.x * p.x + p.y * p.y);
    const Point shift = tangential(camera.distortion, p);
    distorted = {p.x * factor + shift.x, p.y * factor + shift.y};
  } else {
    const double r = std::hypot(p.x, p.y);
    const double factor = r == 0.0 ? 1.0 : fisheye_angle(camera.distortion, std::atan(r)) / r;
    distorted = {p.x * factor, p.y * factor};
  }
  return {camera.fx * distorted.x + camera.cx, camera.fy * distorted.y + camera.cy};
}

Point unproject(const Camera& camera, Point pixel) {
  const Point distorted = {(pixel.x - camera.cx) / camera.fx, (pixel.y - camera.cy) / camera.fy};
  return camera.model == CameraModel::pinhole ? unproject_pinhole(camera, distorted)
                                              : unproject_fisheye(camera, distorted);
}

double fold_radius(const Camera& camera) {
  // The scan takes steps of a thousandth or less, which are far finer than a pixel of any supported camera.
  const bool fisheye = camera.model == CameraModel::fisheye;
  const double limit = fisheye ? half_pi : 10.0;
  constexpr int steps = 10000;
  double before = 0.0;
  for (int i = 1; i <= steps; ++i) {
    const double r = limit * i / steps;
    const double now = distorted_radius(camera, r);
    if (!(now > before)) return fisheye ? std::tan(limit * (i - 1) / steps) : limit * (i - 1) / steps;
    before = now;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace endosdk
