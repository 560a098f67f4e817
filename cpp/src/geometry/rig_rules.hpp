// What the numbers of a calibration must satisfy.
#pragma once

#include <endosdk/endosdk.h>

namespace endosdk {

// Whether a field of view is stated: middle x, y and half axes along x and y, px; all 0 where it is not.
bool states_field(const double* field);

// Refuses one that is no ellipse in a frame of this size.
void check_field_of_view(const double* field, int width, int height, const char* argument);

void check_rig(const endo_calibration& rig);

}  // namespace endosdk
