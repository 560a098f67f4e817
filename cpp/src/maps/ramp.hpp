// How much a value counts: from all to nothing between two bounds.
#pragma once

#include <algorithm>

namespace endosdk {

// 1 up to `full`, 0 from `none` on, straight between. No number gives no number.
inline float ramp(float value, float full, float none) { return std::clamp((none - value) / (none - full), 0.0f, 1.0f); }

}  // namespace endosdk
