// A model's inputs and outputs. Checks that they are those of a stereo model, and finds the sides that they leave open.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "images/size.hpp"
#include "library/runtime.hpp"

namespace endosdk {

void check_interface(const Runtime& runtime, const OrtSession* session);

// Names of the open sides of the inputs, and their lengths for one pair of this size.
using OpenSides = std::vector<std::pair<std::string, int64_t>>;
OpenSides open_sides(const Runtime& runtime, const OrtSession* session, Size input);

}  // namespace endosdk
