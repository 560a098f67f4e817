// Synthetic pairs of pictures of surfaces with known disparity and depth, and the rig that would see them.
#pragma once

#include <cstdint>
#include <vector>

#include "frame_path/frame.hpp"
#include "geometry/rig.hpp"

namespace endosdk {

class KnownPair {
 public:
  // A plane. It is `shift` pixels further left in the right frame. The right camera also looks some rows higher, so that rows
  // match only after rectification.
  static KnownPair plane(Size size, int shift);

  // The same with bands one below the other, whose shift grows from `far_px` to `near_px`, in colours of several kinds.
  static KnownPair bands(Size size, int far_px, int near_px);

  Size size() const { return rig_.size(); }
  const Rig& rig() const { return rig_; }
  FramePair frames() const;

  // Depth of a surface with this shift.
  double depth_mm(double shift) const;

  // Disparity of a plane at this depth, in the rectified pair.
  double disparity_px(double depth_mm) const;

 private:
  KnownPair(Size size, std::vector<uint8_t> left, std::vector<uint8_t> right);

  Rig rig_;
  std::vector<uint8_t> left_;
  std::vector<uint8_t> right_;
};

}  // namespace endosdk
