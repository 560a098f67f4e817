// The test that a device runs when it is switched on. It checks that this model still gives the right result on this machine.
#pragma once

#include <memory>

#include "frame_path/cancelling.hpp"
#include "frame_path/golden_answers.hpp"
#include "frame_path/session.hpp"

namespace endosdk {

// Computes a plane of known depth twice, through the whole frame path: rectification, the network, every map. Its frames have the
// size of the network's pictures. Throws ENDO_SELF_TEST_FAILED if a result is wrong.
void check_answer_to_plane(std::shared_ptr<Session> session, Size picture, Work& work);

struct CellsOfAnswer {
  GoldenCells disparity;
  GoldenCells confidence;
};

// The answer to the built-in pair of bands, through the whole frame path. The session takes pictures of the golden size.
CellsOfAnswer cells_of_answer(std::shared_ptr<Session> session, Work& work);

// Throws ENDO_SELF_TEST_FAILED if this answer is not the golden one.
void check_golden_answer(std::shared_ptr<Session> session, const GoldenAnswer& golden, Work& work);

}  // namespace endosdk
