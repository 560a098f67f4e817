// Reads a rig from the text of a file that endosdk writes.
#pragma once

#include <endosdk/endosdk.h>

#include <string_view>

namespace endosdk {

// Format and version that a file must state.
constexpr const char* rig_file_format = "endosdk-stereo-calibration";
constexpr int rig_file_version = 1;

// The longest text that is read. A file for two cameras takes about two thousand bytes.
constexpr size_t longest_rig_file = 1 << 20;

// The text is JSON as described in python/endosdk/calibration/files/native.py. Throws CALIBRATION_UNREADABLE for any other
// text, and if the stated hash is not that of the content. Throws INVALID_CALIBRATION for numbers that no rig can have.
endo_calibration read_rig_file(std::string_view text);

}  // namespace endosdk
