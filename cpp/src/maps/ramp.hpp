// A linear weight that falls from 1 to 0 between two bounds.
#pragma once

#include <algorithm>

namespace endosdk {

// 1 up to `full`, 0 from `none` on, linear in between. NaN gives NaN.
inline float ramp(float value, float full, float none) { return std::clamp((none - value) / (none - full), 0.0f, 1.0f); }

}  // namespace endosdk
