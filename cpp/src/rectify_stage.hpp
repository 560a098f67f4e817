// From two camera frames of one size to the pictures that the network sees.
#pragma once

#include <functional>
#include <optional>

#include "image.hpp"
#include "rectify.hpp"
#include "rig.hpp"

namespace endosdk {

class RectifyStage {
 public:
  // Raw frames of a rig are rectified; frames without a rig, or of a rectified one, are only repacked, or resized when
  // the network works at another size. Maps of large frames take a while: `checkpoint` is called between them, and may
  // throw.
  RectifyStage(Size frame, const Rig* rig, std::optional<Size> network, const std::function<void()>& checkpoint);

  Size frame() const { return frame_; }
  Size picture() const { return picture_; }

  void operator()(const ImageView& left, const ImageView& right, const PlanarView& out_left, const PlanarView& out_right,
                  ChannelOrder order, RectifyScratch& scratch) const;

  // Masks of the frame's size; null when every pixel is valid.
  const uint8_t* valid_left() const { return masks() ? masks()->valid_left().data() : nullptr; }
  const uint8_t* valid_right() const { return masks() ? masks()->valid_right().data() : nullptr; }

 private:
  // The masks belong to the maps that are returned, which keep the size of the frames.
  const Rectifier* masks() const {
    if (full_) return &*full_;
    return is_raw_ && rectifier_ ? &*rectifier_ : nullptr;
  }

  Size frame_;
  Size picture_;
  bool is_raw_ = false;
  std::optional<Rectifier> rectifier_;
  std::optional<Rectifier> full_;
};

}  // namespace endosdk
