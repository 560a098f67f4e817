// Tests whether measured rotations of a rig count as chance, as drift, or lead to a correction.
#include <cmath>

#include "check.hpp"
#include "geometry/pose_filter.hpp"

using namespace endosdk;

namespace {

constexpr double degree = 1.0 / degrees_per_radian;

// Rotations about x, y and z, with their standard errors, degrees.
PoseError error_of(const std::array<double, 3>& turns, const std::array<double, 3>& standard_errors) {
  PoseError error;
  error.measured = true;
  for (size_t i = 0; i < 3; ++i) {
    error.value[i] = degree * turns[i];
    error.covariance[i * (pose_terms + 1)] = degree * standard_errors[i] * degree * standard_errors[i];
  }
  return error;
}

// A picture may tell little about the rotation about y. This must not hide a rotation about x.
void test_an_uncertain_axis_hides_no_other() {
  const PoseError error = error_of({-0.28, -0.64, 0.07}, {0.025, 0.33, 0.04});
  const PoseVector certain = error.certain_turns();
  CHECK(certain[0] == error.value[0] && certain[1] == 0.0 && certain[2] == 0.0);
  CHECK(std::abs(turn_length(certain) - 0.28 * degree) < 1e-12);
  CHECK(has_drifted(error));
}

void test_chance_is_no_drift() {
  CHECK(!has_drifted(error_of({0.3, -0.6, 0.2}, {0.1, 0.3, 0.1})));
  CHECK(!has_drifted(error_of({0.05, 0.0, 0.0}, {0.001, 0.001, 0.001})));  // certain, but too small to matter
  CHECK(!has_drifted(PoseError()));
}

void test_a_correction_moves_certain_axes_alone() {
  const auto next = next_correction({}, error_of({-0.28, -0.64, 0.07}, {0.025, 0.33, 0.04}));
  CHECK(next.has_value());
  CHECK((*next)[0] < 0.0 && (*next)[0] >= -0.1 * degree && (*next)[1] == 0.0 && (*next)[2] == 0.0);
  CHECK(!next_correction({}, error_of({0.0, 0.6, 0.0}, {0.02, 0.3, 0.02})).has_value());
  PoseVector made{};
  made[0] = -0.28 * degree;
  CHECK(!next_correction(made, error_of({-0.28, 0.0, 0.0}, {0.025, 0.3, 0.04})).has_value());
}

void test_a_still_picture_makes_a_rotation_hardly_more_certain() {
  PoseError frame = error_of({0.0, 0.12, 0.0}, {0.05, 0.1, 0.05});
  for (size_t i = 3; i < pose_terms; ++i) frame.covariance[i * (pose_terms + 1)] = 1e-4;
  PoseFilter moving;
  PoseFilter still;
  for (int i = 0; i < 500; ++i) {
    moving.add(frame, {}, i % 4 == 0);
    still.add(frame, {}, i == 0);
  }
  CHECK(has_drifted(moving.value()));
  CHECK(!has_drifted(still.value()) && !next_correction({}, still.value()).has_value());
  CHECK(still.value().standard_error(1) > 0.05 * degree);
  // What is known of other views is not forgotten before a still picture.
  const double known = moving.value().standard_error(1);
  for (int i = 0; i < 3000; ++i) moving.add(frame, {}, false);
  CHECK(has_drifted(moving.value()) && moving.value().standard_error(1) < 1.1 * known);
}

}  // namespace

int main() {
  test_an_uncertain_axis_hides_no_other();
  test_chance_is_no_drift();
  test_a_correction_moves_certain_axes_alone();
  test_a_still_picture_makes_a_rotation_hardly_more_certain();
  return 0;
}
