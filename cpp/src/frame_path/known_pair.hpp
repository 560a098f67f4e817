// A pair of pictures that no camera took, of a plane whose disparity and depth are known, and the rig that would see it.
#pragma once

#include <cstdint>
#include <vector>

#include "frame_path/frame.hpp"
#include "geometry/rig.hpp"

namespace endosdk {

class KnownPair {
 public:
  // The plane is `shift` pixels further left in the right frame. That camera also looks some rows higher, so that no row of it
  // has its match before the pair was rectified.
  KnownPair(Size size, int shift);

  Size size() const { return rig_.size(); }
  const Rig& rig() const { return rig_; }
  FramePair frames() const;

  double depth_mm() const { return depth_mm_; }

  // Of the plane at this depth, once the pair is rectified.
  double disparity_px(double depth_mm) const;

 private:
  Rig rig_;
  double depth_mm_;
  std::vector<uint8_t> left_;
  std::vector<uint8_t> right_;
};

}  // namespace endosdk
