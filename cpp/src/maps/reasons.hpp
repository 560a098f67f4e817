// Why a pixel is not valid. A reason is written here, and in the public header, which a static_assert ties to this.
#pragma once

#include <cstdint>

namespace endosdk {

// Bits of a pixel's reasons; zero means that its depth can be used.
enum Reason : uint8_t {
  low_confidence = 1,
  occluded = 2,
  outside_overlap = 4,
  out_of_range = 8,
  saturated = 16,
};

struct ReasonFact {
  Reason bit;
  const char* name;
  const char* meaning;
};

constexpr ReasonFact reason_facts[] = {
    {low_confidence, "LOW_CONFIDENCE", "the network does not trust its own answer, or the two views do not agree on it"},
    {occluded, "OCCLUDED", "a nearer surface covers the match in the right view"},
    {outside_overlap, "OUTSIDE_OVERLAP", "the right camera does not see this point, or the lens map has no source pixel"},
    {out_of_range, "OUT_OF_RANGE", "no finite positive depth, one outside the range asked for, or one that the network cannot find"},
    {saturated, "SATURATED", "all three colours of the left view are blown out: glare"},
};

constexpr int saturation_level = 250;  // of all channels

}  // namespace endosdk
