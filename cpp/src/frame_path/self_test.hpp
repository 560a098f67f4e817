// The test that a device runs when it is switched on. It checks that this model still gives the right result on this machine.
#pragma once

#include <memory>

#include "frame_path/cancelling.hpp"

namespace endosdk {

// Computes a built-in pair with known depth twice, through the whole frame path: rectification, the network, every map. Its
// frames have the size of the network's pictures. Throws ENDO_SELF_TEST_FAILED if a result is wrong.
void run_self_test(std::shared_ptr<Session> session, Size picture, Work& work);

}  // namespace endosdk
