#include "geometry/rig_rules.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "geometry/linear.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

// Files print rotations with four or more decimals, which leave up to 1.5e-4 in R R'. The nearest rotation is used.
constexpr double orthonormal_tolerance = 3e-4;

// Of the frame's width and height. Smaller ones are stated in another unit, such as shares of the width.
constexpr double least_half_axis = 0.05;

template <typename Rule, typename Value>
void require_rig(bool holds, const char* argument, const Rule& rule, const Value& value) {
  require(holds, ENDO_INVALID_CALIBRATION, argument, rule, value);
}

void check_finite(const double* values, int count, const char* argument) {
  for (int i = 0; i < count; ++i) require_rig(std::isfinite(values[i]), argument, "must be finite", values[i]);
}

// A count that was forgotten would leave the pictures distorted, and nothing would say so.
void check_past_count(const double (&coefficients)[8], int count, const char* argument) {
  const auto* const stray = std::find_if(coefficients + count, std::end(coefficients), [](double value) { return value != 0.0; });
  require_rig(stray == std::end(coefficients), argument,
              Text("must be 0 past the ", count, " coefficients that its count states"),
              stray == std::end(coefficients) ? 0.0 : *stray);
}

}  // namespace

void check_camera_matrix(const double* k, const char* argument) {
  check_finite(k, 9, argument);
  require_rig(k[0] > 0.0 && k[4] > 0.0, argument, "must have positive focal lengths",
              Text(k[0], ", ", k[4]));
  const bool plain = k[1] == 0.0 && k[3] == 0.0 && k[6] == 0.0 && k[7] == 0.0 && k[8] == 1.0;
  require_rig(plain, argument, "must read fx 0 cx, 0 fy cy, 0 0 1; skew is not supported",
              Text(k[0], " ", k[1], " ", k[2], ", ", k[3], " ", k[4], " ", k[5], ", ", k[6], " ", k[7], " ", k[8]));
}

void check_distortion(const double* coefficients, int count, bool fisheye, const char* argument) {
  const bool known = count == 0 || count == 4 || (!fisheye && (count == 5 || count == 8));
  require_rig(known, argument, fisheye ? "must have 0 or 4 coefficients for a fisheye" : "must have 0, 4, 5 or 8 coefficients",
              count);
  check_finite(coefficients, count, argument);
}

void check_rotation(const double* rotation, const char* argument) {
  check_finite(rotation, 9, argument);
  Mat3 r;
  for (size_t i = 0; i < r.size(); ++i) r[i] = rotation[i];
  const Mat3 gram = multiply(r, transpose(r));
  double error = 0.0;
  for (size_t i = 0; i < gram.size(); ++i) error = std::fmax(error, std::fabs(gram[i] - (i % 4 == 0 ? 1.0 : 0.0)));
  require_rig(error <= orthonormal_tolerance, argument, Text("must be orthonormal: R R' may differ from I by ", orthonormal_tolerance), error);
  require_rig(determinant(r) > 0.0, argument, "must have determinant +1; this one mirrors", determinant(r));
}

void check_translation(const double* t, const char* argument) {
  check_finite(t, 3, argument);
  const double x = std::fabs(t[0]);
  const double y = std::fabs(t[1]);
  const double z = std::fabs(t[2]);
  const Text seen(t[0], ", ", t[1], ", ", t[2]);
  require_rig(x > 0.0 || y > 0.0 || z > 0.0, argument, "must not be zero: the baseline must be positive", seen);
  require_rig(x >= y || y < z, argument,
              "must point along x: this rig is vertical; turn both pictures by 90 degrees and calibrate again", seen);
  require_rig(x >= z, argument, "must point along x: one camera stands in front of the other", seen);
  require_rig(t[0] < 0.0, argument,
              "must have negative x: the cameras are swapped, or the transform runs from right to left", seen);
}

bool states_field(const double* field) {
  return std::any_of(field, field + 4, [](double value) { return value != 0.0; });
}

void check_field_of_view(const double* field, int width, int height, const char* argument) {
  check_finite(field, 4, argument);
  if (!states_field(field)) return;
  const Text seen(field[0], ", ", field[1], ", ", field[2], ", ", field[3]);
  const bool large = field[2] >= least_half_axis * width && field[3] >= least_half_axis * height;
  require_rig(large, argument, "must be middle x, y and half axes x, y in px, half axes at least a twentieth of the frame's sides", seen);
  const auto reaches = [](double middle, double half, int side) { return middle + half > 0.0 && middle - half < side - 1.0; };
  require_rig(reaches(field[0], field[2], width) && reaches(field[1], field[3], height), argument,
              Text("must reach into the frame, ", width, "x", height), seen);
}

void check_plausible_baseline(const endo_calibration& rig) {
  const double* const t = rig.translation;
  const double baseline = std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
  require_rig(baseline >= plausible_baseline_mm[0] && baseline <= plausible_baseline_mm[1], "translation",
              Text("must be in mm: a baseline of ", plausible_baseline_mm[0], " to ", plausible_baseline_mm[1], " mm"), Text(baseline, " mm"));
}

void check_rig(const endo_calibration& rig) {
  require_rig(rig.camera_model == ENDO_PINHOLE || rig.camera_model == ENDO_FISHEYE, "camera_model",
              "must be ENDO_PINHOLE or ENDO_FISHEYE", rig.camera_model);
  require(rig.width > 0 && rig.height > 0, ENDO_INVALID_ARGUMENT, "size", "must be two positive whole numbers",
          Text(rig.width, "x", rig.height));
  const bool fisheye = rig.camera_model == ENDO_FISHEYE;
  check_camera_matrix(rig.left_matrix, "left_matrix");
  check_camera_matrix(rig.right_matrix, "right_matrix");
  check_distortion(rig.left_distortion, rig.left_distortion_count, fisheye, "left_distortion");
  check_distortion(rig.right_distortion, rig.right_distortion_count, fisheye, "right_distortion");
  check_past_count(rig.left_distortion, rig.left_distortion_count, "left_distortion");
  check_past_count(rig.right_distortion, rig.right_distortion_count, "right_distortion");
  check_field_of_view(rig.left_field_of_view, rig.width, rig.height, "left_field_of_view");
  check_field_of_view(rig.right_field_of_view, rig.width, rig.height, "right_field_of_view");
  check_rotation(rig.rotation, "rotation");
  check_translation(rig.translation, "translation");
}

}  // namespace endosdk
