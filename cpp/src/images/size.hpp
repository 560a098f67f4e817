// Width and height of a picture in pixels.
#pragma once

#include <cstddef>
#include <ostream>

namespace endosdk {

struct Size {
  int width = 0;
  int height = 0;

  bool operator==(const Size&) const = default;
};

// Writes a size in the form that messages show: 960x720.
inline std::ostream& operator<<(std::ostream& out, Size size) { return out << size.width << 'x' << size.height; }

constexpr int longest_side = 32767;  // px; positions in a picture are stored in 16 bits

// Number of pixels.
inline size_t count_of(Size size) { return static_cast<size_t>(size.width) * static_cast<size_t>(size.height); }

// Number of bytes of an RGB picture of this size.
inline size_t rgb_bytes(Size size) { return 3 * count_of(size); }

}  // namespace endosdk
