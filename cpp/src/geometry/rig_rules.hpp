// What the numbers of a calibration must satisfy.
#pragma once

#include <endosdk/endosdk.h>

namespace endosdk {

void check_rig(const endo_calibration& rig);

}  // namespace endosdk
