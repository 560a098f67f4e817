// What the numbers of a calibration must satisfy.
#pragma once

#include <endosdk/endosdk.h>

#include <array>

namespace endosdk {

// Whether a field of view is stated: middle x, y and half axes along x and y, px; all 0 where it is not.
bool states_field(const double* field);

// mm. No stereo endoscope lies outside, nor a rig used to test one, nor that of a car (540 mm); a metre taken for a millimetre
// does.
constexpr std::array<double, 2> plausible_baseline_mm = {0.5, 1000.0};

// Refuses numbers that only a mistaken unit explains.
void check_plausible_baseline(const endo_calibration& rig);

// Each refuses what is not so; `argument` is the name in its message. A camera matrix without skew, row by row.
void check_camera_matrix(const double* matrix, const char* argument);

// As many numbers as the camera model knows, all finite.
void check_distortion(const double* coefficients, int count, bool fisheye, const char* argument);

// Orthonormal within what files round away, and no mirror.
void check_rotation(const double* rotation, const char* argument);

// From a left camera to one on its right.
void check_translation(const double* translation, const char* argument);

// An ellipse that reaches into a frame of this size.
void check_field_of_view(const double* field, int width, int height, const char* argument);

void check_rig(const endo_calibration& rig);

}  // namespace endosdk
