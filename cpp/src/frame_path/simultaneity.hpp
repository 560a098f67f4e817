// Whether the two views of a rig are of one moment. A single pair cannot tell a late view from a camera that turned; a
// sequence can: where one view is late, matches leave their rows in step with the motion of the picture.
#pragma once

#include <optional>

#include "geometry/pose_error.hpp"
#include "images/size.hpp"
#include "maps/image_motion.hpp"

namespace endosdk {

// By how many frames a view is late, from pairs of numbers: a line through the rows by which matches lie lower against those
// by which the picture's content lay lower in the frame before. Older frames fade.
class LagFit {
 public:
  void add(double moved_px, double rows_px);

  int frames() const { return frames_; }
  double lag() const;              // frames
  double lag_se() const;           // its standard error, with what neighbouring frames have in common
  double usual_motion_px() const;  // root mean square of the motion per frame

 private:
  int frames_ = 0;
  double sum_ = 0.0, x_ = 0.0, y_ = 0.0, xx_ = 0.0, xy_ = 0.0, yy_ = 0.0;
};

// Of one source, frame by frame in their order.
class Simultaneity {
 public:
  // Reserves what frames like this one need, and forgets the frame before.
  void make_room(const BrightnessPyramid& view);

  // `view` is the left view, whose memory it takes in exchange for that of the frame before; `row_px` says how many rows of
  // the frame a row of the picture is worth. Returns vertical motion between the views, px of the frame: 0 where there
  // is none for certain, nothing as long as too little is known.
  std::optional<double> motion_between(BrightnessPyramid& view, double row_px, const PoseError& pose);

 private:
  bool has_former_ = false;
  BrightnessPyramid former_;
  ImageMotion motion_;
  LagFit right_;  // how late the right view is
  LagFit left_;   // and the left one, negative: the rows of a frame are the motion that its left view shows a frame later
  std::optional<double> former_rows_px_;
};

}  // namespace endosdk
