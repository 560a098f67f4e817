#include "frame_path/working_distance.hpp"

#include <cmath>
#include <cstdio>
#include <limits>

#include "frame_path/rectify_stage.hpp"
#include "maps/postprocess.hpp"

namespace endosdk {
namespace {

constexpr double usual_nearest_mm = 30.0;  // instruments usually work at this distance or farther
constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

double largest_disparity(const ModelInfo& model, Size frame, Size network) {
  if (model.max_candidate_disparity == 0) return unknown;
  return (model.max_candidate_disparity - range_margin) * (static_cast<double>(frame.width) / network.width);
}

double nearest_depth_mm(const Rig& rig, double largest_disparity) {
  const RectifiedGeometry& g = rig.geometry();
  const double farthest_apart = largest_disparity + g.doffs() - RectifyStage::right_shift_of(&rig);
  return farthest_apart > 0.0 ? g.focal_px() * g.baseline_mm() / farthest_apart : unknown;
}

std::optional<RangeNote> range_note(double nearest_mm, const Limits& limits) {
  if (std::isnan(nearest_mm)) return std::nullopt;
  char line[160];  // enough for any two numbers: %g is short even for absurd numbers of a rig
  const auto write = [&](const char* format, auto... numbers) {
    const int start = std::snprintf(line, sizeof line, "nearest depth this model sees on this rig: %.9g mm", std::ceil(nearest_mm));
    std::snprintf(line + start, sizeof line - static_cast<size_t>(start), format, numbers...);
    return std::string(line);
  };
  if (limits.max_depth_mm <= nearest_mm) {
    return RangeNote{ENDO_LOG_WARNING, write("; no pixel has an answer up to the %g mm asked for", limits.max_depth_mm)};
  }
  if (limits.min_depth_mm > 0.0 && limits.min_depth_mm < nearest_mm) {
    return RangeNote{ENDO_LOG_WARNING, write("; depths from %g mm on are asked for", limits.min_depth_mm)};
  }
  if (limits.min_depth_mm == 0.0 && nearest_mm > usual_nearest_mm) {
    return RangeNote{ENDO_LOG_WARNING, write("%s", "; instruments come nearer, and get no depth there")};
  }
  return RangeNote{ENDO_LOG_INFO, write("%s", "")};
}

}  // namespace endosdk
