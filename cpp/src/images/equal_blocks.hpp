// Blocks of the raw frames in which both cameras show the same pixels at the same place. Two cameras never see tissue like that:
// a program has drawn there, such as text, a menu or an inset.
#pragma once

#include <cstdint>
#include <vector>

#include "images/image.hpp"
#include "images/size.hpp"

namespace endosdk {

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class EqualBlocks {
 public:
  enum Mark : uint8_t {
    differs,
    equal,    // may be a part of what a program has drawn, or flat in both frames
    telling,  // has steps along its rows, which would lie elsewhere in the other frame if both showed a scene
  };

  // About 60 blocks along a row.
  static int side_of(Size frame);
  static Size blocks_of(Size frame);

  // Compares two frames of one shape. If no block tells, none is marked as equal.
  void compare(const ImageView& left, const ImageView& right);

  Size size() const { return size_; }
  bool any() const { return any_; }  // whether a block tells
  const std::vector<uint8_t>& marks() const { return marks_; }  // a `Mark` for each block, row by row

 private:
  Size size_;
  bool any_ = false;
  std::vector<uint8_t> marks_;
};

}  // namespace endosdk
