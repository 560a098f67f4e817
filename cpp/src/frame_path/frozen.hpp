// Whether a camera, or what stands between it and us, repeats an old picture. A real picture never comes twice: it has noise.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "images/image.hpp"

namespace endosdk {

// A number for a sixteenth of the bytes, from all over the picture: it changes with whatever is sixteen rows high.
uint64_t print_of(const ImageView& image);

using Prints = std::array<uint64_t, 2>;  // of the left and the right frame

// Of one source, frame by frame in their order.
class Frozen {
 public:
  // Frames in a row in which one view alone did not change, from the 5th on. Both views may stand still for a while, at a higher rate than
  // the cameras' or on a picture that is shown on purpose: they count from the 25th on.
  int repeats(const Prints& prints);

  // Whether one view alone stands still, from its first repeated frame on.
  bool one_stands_still() const { return repeats_[0] != repeats_[1]; }

 private:
  Prints latest_{};
  bool any_ = false;
  std::array<int, 2> repeats_{};
};

}  // namespace endosdk
