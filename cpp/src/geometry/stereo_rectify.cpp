#include "geometry/stereo_rectify.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "platform/errors.hpp"

namespace endosdk {
namespace {

// The rotations that bring both image planes into one plane, with the x axis along the baseline.
struct Alignment {
  Mat3 left;
  Mat3 right;
  double baseline_x = 0.0;  // x of the translation in the rectified frame; negative when the right camera is on the right
};

Alignment align(const StereoRig& rig) {
  // First, each camera turns by half of the rotation between them.
  const Vec3 turn = rotation_vector(nearest_rotation(rig.rotation));
  const Mat3 half = rotation_matrix(scale(turn, -0.5));
  const Vec3 t = multiply(half, rig.translation);
  require(std::fabs(t[0]) > std::fabs(t[1]), ENDO_INVALID_CALIBRATION, "translation", "the cameras must lie side by side, not one above the other",
          std::to_string(t[0]) + ", " + std::to_string(t[1]) + " along x and y");
  // Then both turn together, by the smallest rotation that brings the baseline onto the x axis.
  Vec3 axis = cross(t, {t[0] > 0.0 ? 1.0 : -1.0, 0.0, 0.0});
  const double length = norm(axis);
  if (length > 0.0) axis = scale(axis, std::acos(std::min(1.0, std::fabs(t[0]) / norm(t))) / length);
  const Mat3 together = rotation_matrix(axis);
  Alignment result;
  result.left = multiply(together, transpose(half));
  result.right = multiply(together, half);
  result.baseline_x = multiply(result.right, rig.translation)[0];
  return result;
}

Mat34 projection(double fx, double fy, Point centre, double shift) {
  return {fx, 0.0, centre.x, shift, 0.0, fy, centre.y, 0.0, 0.0, 0.0, 1.0, 0.0};
}

Point rotate(const Mat3& rotation, Point p) {
  const Vec3 ray = multiply(rotation, Vec3{p.x, p.y, 1.0});
  return {ray[0] / ray[2], ray[1] / ray[2]};
}

// The mean of the rectified positions of the four image corners, for a principal point at zero.
Point mean_corner(const Camera& camera, const Mat3& rotation, int width, int height, double focal) {
  Point sum;
  for (int corner = 0; corner < 4; ++corner) {
    const Point pixel = {(corner % 2) * (width - 1.0), (corner / 2) * (height - 1.0)};
    const Point ray = rotate(rotation, unproject(camera, pixel));
    sum = {sum.x + focal * ray.x, sum.y + focal * ray.y};
  }
  return {sum.x / 4.0, sum.y / 4.0};
}

struct Bounds {
  double left, right, top, bottom;
};

// The largest rectangle inside the rectified outline of the raw image, and the smallest rectangle around it.
struct Outline {
  Bounds inner;
  Bounds outer;
};

Outline outline(const Camera& camera, const Mat3& rotation, int width, int height, double focal, Point centre) {
  constexpr int grid = 9;
  constexpr double far = std::numeric_limits<double>::max();
  Outline o{{-far, far, -far, far}, {far, -far, far, -far}};
  for (int row = 0; row < grid; ++row) {
    for (int column = 0; column < grid; ++column) {
      const Point pixel = {column * (width - 1.0) / (grid - 1), row * (height - 1.0) / (grid - 1)};
      const Point ray = rotate(rotation, unproject(camera, pixel));
      const Point p = {focal * ray.x + centre.x, focal * ray.y + centre.y};
      o.outer = {std::min(o.outer.left, p.x), std::max(o.outer.right, p.x), std::min(o.outer.top, p.y),
                 std::max(o.outer.bottom, p.y)};
      if (column == 0) o.inner.left = std::max(o.inner.left, p.x);
      if (column == grid - 1) o.inner.right = std::min(o.inner.right, p.x);
      if (row == 0) o.inner.top = std::max(o.inner.top, p.y);
      if (row == grid - 1) o.inner.bottom = std::min(o.inner.bottom, p.y);
    }
  }
  return o;
}

// For each side of `bounds`, the factor by which to enlarge the picture about `centre` so that it reaches that side of the
// image.
std::array<double, 4> enlargements(const Bounds& bounds, Point centre, int width, int height) {
  return {centre.x / (centre.x - bounds.left), centre.y / (centre.y - bounds.top),
          (width - 1 - centre.x) / (bounds.right - centre.x), (height - 1 - centre.y) / (bounds.bottom - centre.y)};
}

// OpenCV enlarges the picture about the principal point until both views fill it. Near an edge of the picture, as in frames that
// were cropped, this enlarges them many times, and outside the picture it cannot work. Beyond this factor the principal point
// is moved instead.
constexpr double most_enlarged = 1.5;

struct Fit {
  double enlarged;
  Point centre;
};

// Fills the picture with the middle of what both views have in common. Enlarges by 0 if they have nothing in common.
Fit fill_with(const Bounds& common, Point centre, int width, int height) {
  if (!(common.left < common.right && common.top < common.bottom)) return {0.0, centre};
  const double s = std::max((width - 1) / (common.right - common.left), (height - 1) / (common.bottom - common.top));
  return {s, {0.5 * (width - 1) + s * (centre.x - 0.5 * (common.left + common.right)),
              0.5 * (height - 1) + s * (centre.y - 0.5 * (common.top + common.bottom))}};
}

Rectification rectify_pinhole(const StereoRig& rig, const Alignment& alignment, double alpha) {
  // The mean vertical focal length keeps the height of rows. Both views share one principal point.
  double focal = 0.5 * (rig.left.fy + rig.right.fy);
  const Point left = mean_corner(rig.left, alignment.left, rig.width, rig.height, focal);
  const Point right = mean_corner(rig.right, alignment.right, rig.width, rig.height, focal);
  Point centre = {0.5 * (rig.width - 1.0) - 0.5 * (left.x + right.x), 0.5 * (rig.height - 1.0) - 0.5 * (left.y + right.y)};
  if (alpha >= 0.0) {
    double crop = 0.0;
    double keep = std::numeric_limits<double>::max();
    constexpr double far = std::numeric_limits<double>::max();
    Bounds common = {-far, far, -far, far};
    for (bool second : {false, true}) {
      const Outline o = outline(second ? rig.right : rig.left, second ? alignment.right : alignment.left, rig.width,
                                rig.height, focal, centre);
      for (double s : enlargements(o.inner, centre, rig.width, rig.height)) crop = std::max(crop, s);
      for (double s : enlargements(o.outer, centre, rig.width, rig.height)) keep = std::min(keep, s);
      common = {std::max(common.left, o.inner.left), std::min(common.right, o.inner.right),
                std::max(common.top, o.inner.top), std::min(common.bottom, o.inner.bottom)};
    }
    const Fit fit = fill_with(common, centre, rig.width, rig.height);
    const bool inside = centre.x > 0.0 && centre.x < rig.width - 1 && centre.y > 0.0 && centre.y < rig.height - 1;
    if (alpha == 0.0 && fit.enlarged > 0.0 && (!inside || crop > std::max(most_enlarged, fit.enlarged))) {
      focal *= fit.enlarged;
      centre = fit.centre;
    } else {
      focal *= crop * (1.0 - alpha) + keep * alpha;
    }
  }
  return {alignment.left, alignment.right, projection(focal, focal, centre, 0.0),
          projection(focal, focal, centre, alignment.baseline_x * focal)};
}

// Focal length and principal point that fit one fisheye view. They follow from the centres of the image's four sides.
struct FisheyeFit {
  double fy;
  Point centre;
};

FisheyeFit fit_fisheye(const Camera& camera, const Mat3& rotation, int width, int height, double alpha) {
  // Whole pixels, as in OpenCV.
  const std::array<Point, 4> sides = {Point{double(width / 2), 0.0}, Point{double(width), double(height / 2)},
                                      Point{double(width / 2), double(height)}, Point{0.0, double(height / 2)}};
  const double aspect = camera.fx / camera.fy;
  constexpr double far = std::numeric_limits<double>::max();
  Bounds b{far, -far, far, -far};
  Point mean;
  for (const Point& side : sides) {
    Point p = rotate(rotation, unproject(camera, side));
    p.y *= aspect;
    mean = {mean.x + 0.25 * p.x, mean.y + 0.25 * p.y};
    b = {std::min(b.left, p.x), std::max(b.right, p.x), std::min(b.top, p.y), std::max(b.bottom, p.y)};
  }
  const double half_width = 0.5 * width;
  const double half_height = 0.5 * height * aspect;
  const auto [low, high] = std::minmax({half_width / (mean.x - b.left), half_width / (b.right - mean.x),
                                        half_height / (mean.y - b.top), half_height / (b.bottom - mean.y)});
  const double f = alpha * low + (1.0 - alpha) * high;
  return {f / aspect, {half_width - mean.x * f, (half_height - mean.y * f) / aspect}};
}

Rectification rectify_fisheye(const StereoRig& rig, const Alignment& alignment, double alpha) {
  const double balance = std::clamp(alpha, 0.0, 1.0);
  const FisheyeFit left = fit_fisheye(rig.left, alignment.left, rig.width, rig.height, balance);
  const FisheyeFit right = fit_fisheye(rig.right, alignment.right, rig.width, rig.height, balance);
  const double focal = std::min(left.fy, right.fy);
  const Point centre = {0.5 * (left.centre.x + right.centre.x), 0.5 * (left.centre.y + right.centre.y)};
  return {alignment.left, alignment.right, projection(focal, focal, centre, 0.0),
          projection(focal, focal, centre, alignment.baseline_x * focal)};
}

void check_rotation(const Mat3& rotation, const char* name) {
  for (double value : rotation) require(std::isfinite(value), name, "every value must be finite", value);
  const Mat3 gram = multiply(rotation, transpose(rotation));
  double error = 0.0;
  for (int i = 0; i < 9; ++i) error = std::max(error, std::fabs(gram[i] - (i % 4 == 0 ? 1.0 : 0.0)));
  require(error < 1e-3, name, "must be orthonormal within 1e-3", error);
  require(determinant(rotation) > 0.0, name, "must not mirror", determinant(rotation));
}

void check_rig(const StereoRig& rig, double alpha) {
  require(rig.width >= 2 && rig.height >= 2, "size", "must be at least 2x2 pixels",
          std::to_string(rig.width) + "x" + std::to_string(rig.height));
  check_camera(rig.left, "left");
  check_camera(rig.right, "right");
  require(rig.left.model == rig.right.model, "model", "must be the same for both cameras", "two models");
  check_rotation(rig.rotation, "rotation");
  for (double value : rig.translation) require(std::isfinite(value), "translation", "every value must be finite", value);
  require(norm(rig.translation) > 0.0, "translation", "must not be zero", 0);
  require(alpha <= 1.0, "alpha", "must be at most 1", alpha);  // also refuses NaN
  require(alpha >= 0.0 || rig.left.model == CameraModel::pinhole, "alpha", "must be 0 to 1 for a fisheye rig", alpha);
}

Mat3 ray_matrix(const ViewGeometry& view) {
  const Mat34& p = view.projection;
  return inverse(multiply(Mat3{p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]}, view.rotation));
}

}  // namespace

Rectification stereo_rectify(const StereoRig& rig, double alpha) {
  check_rig(rig, alpha);
  const Alignment alignment = align(rig);
  const Rectification result = rig.left.model == CameraModel::pinhole ? rectify_pinhole(rig, alignment, alpha)
                                                                      : rectify_fisheye(rig, alignment, alpha);
  const double focal = result.left_projection[0];
  require(std::isfinite(focal) && focal > 0.0, ENDO_INVALID_CALIBRATION, "calibration", "must leave a picture after rectification",
          "a rectified focal length of " + std::to_string(focal));
  return result;
}

void check_view(const ViewGeometry& view, const char* name) {
  check_camera(view.camera, name);
  check_rotation(view.rotation, (std::string(name) + " rotation").c_str());
  const std::string argument = std::string(name) + " projection";
  for (double value : view.projection) require(std::isfinite(value), argument, "every value must be finite", value);
  require(view.projection[0] > 0.0 && view.projection[5] > 0.0, argument, "the focal lengths must be positive",
          view.projection[0] > 0.0 ? view.projection[5] : view.projection[0]);
  const bool plain = view.projection[1] == 0.0 && view.projection[4] == 0.0 && view.projection[8] == 0.0 &&
                     view.projection[9] == 0.0 && view.projection[10] == 1.0;
  require(plain, argument, "must be [[f, 0, cx, t], [0, f, cy, 0], [0, 0, 1, 0]]", "another form");
}

SourceMap::SourceMap(const ViewGeometry& view) : camera_(view.camera), to_ray_(ray_matrix(view)) {
  const double fold = fold_radius(view.camera);
  fold_squared_ = fold * fold;
}

SourceMap::Source SourceMap::at(double x, double y) const {
  const Vec3 ray = multiply(to_ray_, Vec3{x, y, 1.0});
  if (!(ray[2] > 0.0)) {
    const double nothing = std::numeric_limits<double>::quiet_NaN();
    return {{nothing, nothing}, false};
  }
  const Point p = {ray[0] / ray[2], ray[1] / ray[2]};
  return {project(camera_, p), p.x * p.x + p.y * p.y <= fold_squared_};
}

}  // namespace endosdk
