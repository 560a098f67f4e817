// A rig from the text of a file that endosdk writes.
#pragma once

#include <endosdk/endosdk.h>

#include <string_view>

namespace endosdk {

// What a file says of itself.
constexpr const char* rig_file_format = "endosdk-stereo-calibration";
constexpr int rig_file_version = 1;

// The longest text; a file of two cameras takes two thousand bytes.
constexpr size_t longest_rig_file = 1 << 20;

// JSON as python/endosdk/calibration/files/native.py describes it. CALIBRATION_UNREADABLE for another text, and where the
// hash that it states is not that of its content; INVALID_CALIBRATION for numbers that no rig has.
endo_calibration read_rig_file(std::string_view text);

}  // namespace endosdk
