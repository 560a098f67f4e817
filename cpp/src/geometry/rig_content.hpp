// A calibration as canonical text. It has the same bytes as the text that the Python package hashes.
#pragma once

#include <endosdk/endosdk.h>

#include <string>

namespace endosdk {

std::string rig_content(const endo_calibration& rig);

}  // namespace endosdk
