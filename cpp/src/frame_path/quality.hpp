// One word on a whole frame, from the share of its pixels that are valid.
#pragma once

namespace endosdk {

enum class Quality { ok = 0, degraded = 1, invalid = 2 };

constexpr double least_share_ok = 0.5;       // below it a frame is degraded
constexpr double least_share_usable = 0.05;  // below it a frame must not be used

constexpr Quality quality_of(double valid_share) {
  if (valid_share < least_share_usable) return Quality::invalid;
  return valid_share < least_share_ok ? Quality::degraded : Quality::ok;
}

}  // namespace endosdk
