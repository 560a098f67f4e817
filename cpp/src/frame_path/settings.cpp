#include "frame_path/settings.hpp"

#include <cmath>

#include "platform/errors.hpp"
#include "platform/threads.hpp"

namespace endosdk {

void check_settings(const FramePathSettings& s) {
  // Where the faces differ, the text is true of both.
  require(s.threads >= 0 && s.threads <= max_threads, "threads",
          Text("must be a whole number, 1 to ", max_threads, "; in C also 0, the default"), s.threads);
  const auto is_side = [](int side) { return side >= 1 && side <= longest_side; };
  require(!s.network || (is_side(s.network->width) && is_side(s.network->height)), "network_size",
          Text("must be (width, height) in whole pixels, 1 to ", longest_side, "; in C network_width and network_height, or both 0"),
          Text("(", s.network.value_or(Size()).width, ", ", s.network.value_or(Size()).height, ")"));
  const Limits& l = s.limits;
  require(l.min_confidence >= 0.0 && l.min_confidence <= 1.0, "min_confidence", "must be a number in 0..1", l.min_confidence);
  require(std::isfinite(l.min_depth_mm) && l.min_depth_mm >= 0.0 && l.max_depth_mm > l.min_depth_mm, "depth_range_mm",
          "must be (nearest, farthest) with 0 <= nearest < farthest; in C min_depth_mm and max_depth_mm",
          Text("(", l.min_depth_mm, ", ", l.max_depth_mm, ")"));
  require(std::isfinite(l.depth_unit_mm) && l.depth_unit_mm >= 1e-6, "depth_unit_mm", "must be finite and at least 1e-6",
          l.depth_unit_mm);
  require(std::isfinite(s.deadline_ms) && s.deadline_ms >= 0.0, "deadline_ms", "must be finite and not negative",
          s.deadline_ms);
  require(std::isfinite(s.max_age_ms) && s.max_age_ms >= 0.0, "max_age_ms", "must be finite and not negative", s.max_age_ms);
}

}  // namespace endosdk
