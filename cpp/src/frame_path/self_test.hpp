// The test that a device runs when it is switched on: is this model, on this machine, still giving the right answer?
#pragma once

#include "frame_path/cancelling.hpp"

namespace endosdk {

// Sends a built-in pair of known disparity through the kernels and the model, twice. Throws ENDO_SELF_TEST_FAILED.
void run_self_test(Session& session, Size picture, Work& work);

}  // namespace endosdk
