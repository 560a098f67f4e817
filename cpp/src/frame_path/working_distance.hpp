// The nearest depth at which a model still finds a surface, and the note about it for the host.
#pragma once

#include <optional>
#include <string>

#include <endosdk/endosdk.h>

#include "frame_path/limits.hpp"
#include "geometry/rig.hpp"
#include "images/size.hpp"
#include "model/model.hpp"

namespace endosdk {

// Largest disparity that counts as an answer, px of the frame. `network` is the size at which the network sees the frame. NaN
// if the model does not state its range.
double largest_disparity(const ModelInfo& model, Size frame, Size network);

// Depth, mm, of a surface with this disparity in the rig's frames. NaN for NaN, and if no depth follows.
double nearest_depth_mm(const Rig& rig, double largest_disparity);

struct RangeNote {
  endo_log_level level;
  std::string line;
};

// The note is a warning if the limits include depths that are nearer than the model sees. Without a nearest depth in the
// limits, the usual distances in endoscopy decide. No note for NaN.
std::optional<RangeNote> range_note(double nearest_mm, const Limits& limits);

}  // namespace endosdk
