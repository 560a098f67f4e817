// What a pixel's disparity says: its depth, the expected error of that, or the reasons why it has none.
#pragma once

#include <cstdint>

namespace endosdk {

// Bits of a pixel's reasons; zero means that its depth can be used.
enum Reason : uint8_t {
  low_confidence = 1,
  occluded = 2,         // a nearer surface covers its match in the right view
  outside_overlap = 4,  // it or its match lies outside a view
  out_of_range = 8,     // no depth, one outside the range asked for, or beyond what the network can find
  saturated = 16,       // all channels at least saturation_level
};

constexpr int saturation_level = 250;

}  // namespace endosdk
