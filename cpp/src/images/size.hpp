// Width and height of a picture in pixels.
#pragma once

#include <cstddef>

namespace endosdk {

struct Size {
  int width = 0;
  int height = 0;
};

constexpr int longest_side = 32767;  // px; positions in a picture are stored in 16 bits

// How many pixels that is.
inline size_t count_of(Size size) { return static_cast<size_t>(size.width) * static_cast<size_t>(size.height); }

}  // namespace endosdk
