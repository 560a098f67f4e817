// Whether a model's inputs and outputs are the ones that a stereo model must have.
#pragma once

#include "library/runtime.hpp"

namespace endosdk {

void check_interface(const Runtime& runtime, const OrtSession* session);

}  // namespace endosdk
