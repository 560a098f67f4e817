// What the numbers of a calibration must satisfy.
#pragma once

#include <endosdk/endosdk.h>

#include <array>

namespace endosdk {

// Whether a field of view is stated: middle x, y and half axes along x and y, px; all 0 where it is not.
bool states_field(const double* field);

// mm. No stereo endoscope and no bench rig used to test one lies outside; a metre taken for a millimetre does.
constexpr std::array<double, 2> plausible_baseline_mm = {0.5, 500.0};

// Refuses numbers that only a mistaken unit explains.
void check_plausible_baseline(const endo_calibration& rig);

// Refuses one that is no ellipse in a frame of this size.
void check_field_of_view(const double* field, int width, int height, const char* argument);

void check_rig(const endo_calibration& rig);

}  // namespace endosdk
