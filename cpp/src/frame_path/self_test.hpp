// The test that a device runs when it is switched on: is this model, on this machine, still giving the right answer?
#pragma once

#include <memory>

#include "frame_path/cancelling.hpp"

namespace endosdk {

// Sends a built-in pair of known depth the whole way of a frame, twice: rectification, the network, every map. Its frames
// have the size of the network's pictures. Throws ENDO_SELF_TEST_FAILED.
void run_self_test(std::shared_ptr<Session> session, Size picture, Work& work);

}  // namespace endosdk
