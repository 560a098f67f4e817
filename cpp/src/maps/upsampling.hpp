// The constants of joint bilateral upsampling. A model's metadata names the constants that the model was trained with. These
// are the defaults, for models whose metadata names none.
#pragma once

namespace endosdk {

struct Upsampling {
  float unlike = 128.0f;         // grey levels: colours whose three channels differ by this sum have the least likeness
  float least_likeness = 1e-6f;  // not 0: if no cell looks alike, all cells count by their distance
};

// Distance along each axis, in pixels of the network's output grid, from which on a pixel does not count.
constexpr int upsampling_reach = 3;

}  // namespace endosdk
