// How near a surface may come before a model finds it no more, and what a host is told of it.
#pragma once

#include <optional>
#include <string>

#include <endosdk/endosdk.h>

#include "frame_path/slot.hpp"
#include "geometry/rig.hpp"
#include "images/size.hpp"
#include "model/model.hpp"

namespace endosdk {

// Largest disparity that counts as an answer, px of frames of this size that the network sees at the other; NaN where the
// model does not state its range.
double largest_disparity(const ModelInfo& model, Size frame, Size network);

// Depth, mm, of a surface at that disparity of the rig's frames; NaN for NaN.
double nearest_depth_mm(const Rig& rig, double largest_disparity);

struct RangeNote {
  endo_log_level level;
  std::string line;
};

// A warning where surfaces nearer than what the model sees are asked for, or usual in endoscopy when the limits name no
// nearest depth; nothing for NaN.
std::optional<RangeNote> range_note(double nearest_mm, const Limits& limits);

}  // namespace endosdk
