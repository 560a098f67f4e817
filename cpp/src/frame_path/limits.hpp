// Limits within which a pixel counts as valid. The defaults are those of both faces.
#pragma once

#include <limits>

namespace endosdk {

struct Limits {
  double min_confidence = 0.9;
  double min_depth_mm = 0.0;
  double max_depth_mm = std::numeric_limits<double>::infinity();
  double depth_unit_mm = 0.1;  // one step of the 16-bit depth map
};

}  // namespace endosdk
