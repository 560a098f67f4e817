// A model's inputs and outputs: whether they are the ones that a stereo model must have, and the sides they leave open.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "images/size.hpp"
#include "library/runtime.hpp"

namespace endosdk {

void check_interface(const Runtime& runtime, const OrtSession* session);

// What the open sides of the inputs are called, and how long they are for one pair of this size.
using OpenSides = std::vector<std::pair<std::string, int64_t>>;
OpenSides open_sides(const Runtime& runtime, const OrtSession* session, Size input);

}  // namespace endosdk
