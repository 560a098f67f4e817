// A synthetic pair of pictures of a plane with known disparity and depth, and the rig that would see it.
#pragma once

#include <cstdint>
#include <vector>

#include "frame_path/frame.hpp"
#include "geometry/rig.hpp"

namespace endosdk {

class KnownPair {
 public:
  // The plane is `shift` pixels further left in the right frame. The right camera also looks some rows higher, so that rows
  // match only after rectification.
  KnownPair(Size size, int shift);

  Size size() const { return rig_.size(); }
  const Rig& rig() const { return rig_; }
  FramePair frames() const;

  double depth_mm() const { return depth_mm_; }

  // Disparity of a plane at this depth, in the rectified pair.
  double disparity_px(double depth_mm) const;

 private:
  Rig rig_;
  double depth_mm_;
  std::vector<uint8_t> left_;
  std::vector<uint8_t> right_;
};

}  // namespace endosdk
