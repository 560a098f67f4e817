// A calibration as canonical text, byte for byte what the Python package hashes.
#pragma once

#include <endosdk/endosdk.h>

#include <string>

namespace endosdk {

std::string rig_content(const endo_calibration& rig);

}  // namespace endosdk
