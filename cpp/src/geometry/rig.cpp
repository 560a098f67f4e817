#include "geometry/rig.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "geometry/rig_content.hpp"
#include "geometry/rig_rules.hpp"
#include "platform/sha256.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

// If two cameras are parallel within this tolerance, their rows differ by less than 0.002 px at 2000 px from the principal
// point.
constexpr double rectified_tolerance = 1e-6;

// fx over fy, or fy over fx. Rectified pixels are square, as OpenCV's, unless the raw ones are more oblong than this, as in
// half-width video. Then the rectified ones have the same form: in a frame of the same size, square ones would show half of the
// scene.
constexpr double most_oblong = 1.05;

// No camera has pixels like that, nor any way to pack two views into a frame.
constexpr double beyond_any_camera = 8.0;

Camera camera(const endo_calibration& rig, bool second) {
  const double* k = second ? rig.right_matrix : rig.left_matrix;
  const double* d = second ? rig.right_distortion : rig.left_distortion;
  const int count = second ? rig.right_distortion_count : rig.left_distortion_count;
  Camera result;
  result.model = rig.camera_model == ENDO_FISHEYE ? CameraModel::fisheye : CameraModel::pinhole;
  result.fx = k[0];
  result.cx = k[2];
  result.fy = k[4];
  result.cy = k[5];
  std::copy_n(d, count, result.distortion.begin());
  return result;
}

bool is_undistorted(const double* coefficients, int count) {
  return std::all_of(coefficients, coefficients + count, [](double value) { return value == 0.0; });
}

// A rectified rig keeps its own cameras.
Rectification keep_views(const endo_calibration& rig) {
  const auto widen = [](const double* k, double shift) {
    return Mat34{k[0], k[1], k[2], shift, k[3], k[4], k[5], 0.0, k[6], k[7], k[8], 0.0};
  };
  const Mat3 identity = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  return {identity, identity, widen(rig.left_matrix, 0.0), widen(rig.right_matrix, rig.right_matrix[0] * rig.translation[0])};
}

Rectification turn_views(const endo_calibration& rig, double alpha) {
  StereoRig stereo;
  stereo.left = camera(rig, false);
  stereo.right = camera(rig, true);
  std::copy(std::begin(rig.rotation), std::end(rig.rotation), stereo.rotation.begin());
  std::copy(std::begin(rig.translation), std::end(rig.translation), stereo.translation.begin());
  stereo.width = rig.width;
  stereo.height = rig.height;
  const double aspect = std::sqrt(stereo.left.fx / stereo.left.fy * stereo.right.fx / stereo.right.fy);
  if (std::max(aspect, 1.0 / aspect) <= most_oblong) return stereo_rectify(stereo, alpha);
  require(std::max(aspect, 1.0 / aspect) <= beyond_any_camera, ENDO_INVALID_CALIBRATION, "left_matrix",
          Text("focal lengths along x and y must be within a factor of ", beyond_any_camera), aspect);
  stereo.width = static_cast<int>(std::lround(rig.width / aspect));
  const double squeeze = static_cast<double>(stereo.width) / rig.width;
  for (Camera* view : {&stereo.left, &stereo.right}) {
    view->fx *= squeeze;
    view->cx = (view->cx + 0.5) * squeeze - 0.5;
  }
  const RectifiedGeometry square = {stereo_rectify(stereo, alpha), {stereo.width, stereo.height}};
  return square.scaled({rig.width, rig.height}).views;
}

constexpr double only_common_pixels = 0.0;

RectifiedGeometry rectified_geometry(const endo_calibration& rig, bool is_rectified, double alpha) {
  RectifiedGeometry result = {is_rectified ? keep_views(rig) : turn_views(rig, alpha), {rig.width, rig.height}};
  const bool usable = result.focal_px() > 0.0 && result.baseline_mm() > 0.0;
  for (const Mat34* view : {&result.views.left_projection, &result.views.right_projection}) {
    for (double value : *view) {
      require(std::isfinite(value), ENDO_INVALID_CALIBRATION, "calibration", "must have a finite rectified geometry", value);
    }
  }
  require(usable, ENDO_INVALID_CALIBRATION, "calibration",
          "must leave a positive focal length and baseline after rectification",
          std::to_string(result.focal_px()) + " px, " + std::to_string(result.baseline_mm()) + " mm");
  return result;
}

// Scales the first two rows of a projection. Pixel centres are whole numbers, so half a pixel is added: c' = (c + 0.5) k - 0.5.
Mat34 scale_rows(Mat34 projection, double x, double y) {
  for (size_t i = 0; i < 4; ++i) {
    projection[i] *= x;
    projection[4 + i] *= y;
  }
  projection[2] += 0.5 * x - 0.5;
  projection[6] += 0.5 * y - 0.5;
  return projection;
}

endo_calibration identity_numbers(Size size) {
  // The focal length and the baseline do not matter: only the change of size is used.
  const double focal = std::max(size.width, size.height);
  endo_calibration rig{};
  rig.struct_size = sizeof rig;
  rig.width = size.width;
  rig.height = size.height;
  for (double* k : {rig.left_matrix, rig.right_matrix}) {
    k[0] = k[4] = focal;
    k[2] = 0.5 * (size.width - 1);
    k[5] = 0.5 * (size.height - 1);
    k[8] = 1.0;
  }
  rig.rotation[0] = rig.rotation[4] = rig.rotation[8] = 1.0;
  rig.translation[0] = -1.0;
  return rig;
}

}  // namespace

bool stands_rectified(const endo_calibration& rig) {
  const double* t = rig.translation;
  const double baseline = norm({t[0], t[1], t[2]});
  bool parallel = true;
  for (int i = 0; i < 9; ++i) {
    parallel = parallel && std::fabs(rig.rotation[i] - (i % 4 == 0 ? 1.0 : 0.0)) <= rectified_tolerance;
  }
  const bool sideways = std::max(std::fabs(t[1]), std::fabs(t[2])) <= rectified_tolerance * baseline;
  bool equal_rows = true;
  for (const int at : {0, 4, 5}) {  // fx, fy, cy
    const double difference = std::fabs(rig.left_matrix[at] - rig.right_matrix[at]);
    equal_rows = equal_rows && difference <= rectified_tolerance * rig.left_matrix[0];
  }
  return is_undistorted(rig.left_distortion, rig.left_distortion_count) &&
         is_undistorted(rig.right_distortion, rig.right_distortion_count) && parallel && sideways && equal_rows;
}

RectifiedGeometry RectifiedGeometry::scaled(Size target) const {
  const double x = static_cast<double>(target.width) / size.width;
  const double y = static_cast<double>(target.height) / size.height;
  Rectification turned = views;
  turned.left_projection = scale_rows(views.left_projection, x, y);
  turned.right_projection = scale_rows(views.right_projection, x, y);
  return {turned, target};
}

Rig::Rig(const endo_calibration& numbers)
    : numbers_((check_rig(numbers), numbers)),
      is_rectified_(stands_rectified(numbers)),
      geometry_(rectified_geometry(numbers, is_rectified_, only_common_pixels)) {
  const std::string content = rig_content(numbers);
  sha256_ = endosdk::sha256(content.data(), content.size());
}

Rig Rig::identity(Size size) { return Rig(identity_numbers(size)); }

RectifiedGeometry Rig::geometry(double alpha) const { return rectified_geometry(numbers_, is_rectified_, alpha); }

const double* Rig::field_of_view(bool right) const {
  const double* const field = right ? numbers_.right_field_of_view : numbers_.left_field_of_view;
  return states_field(field) ? field : nullptr;
}

ViewGeometry Rig::view(bool right, const RectifiedGeometry& target) const {
  const Rectification& views = target.views;
  if (right) return {camera(numbers_, true), views.right_rotation, views.right_projection};
  return {camera(numbers_, false), views.left_rotation, views.left_projection};
}

Rectifier Rig::rectifier(const RectifiedGeometry& target, Border border) const {
  return {size(), target.size, view(false, target), view(true, target), border};
}

}  // namespace endosdk
