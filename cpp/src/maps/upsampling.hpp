// The constants of joint bilateral upsampling. A model's metadata names those it was trained through; these are the
// defaults, and what a model without them was trained through.
#pragma once

namespace endosdk {

struct Upsampling {
  float unlike = 128.0f;         // sum of the differences of three channels, grey levels, from which colours are altogether unlike
  float least_likeness = 1e-6f;  // of such colours: with nothing alike around, all count as they lie
};

// Along each axis, in pixels of the network's grid, how far away one counts for nothing.
constexpr int upsampling_reach = 3;

}  // namespace endosdk
