// The median that the robust estimates of this library take.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace endosdk {

// The upper one of an even number; the values are put in another order. There must be at least one.
inline float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace endosdk
