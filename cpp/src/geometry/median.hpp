// The median, for the robust estimates of this library.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace endosdk {

// The median; for an even number of values, the upper of the two. It changes the order of the values. There must be at least
// one.
inline float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace endosdk
