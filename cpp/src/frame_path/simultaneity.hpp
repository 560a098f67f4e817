// Detects whether the two views of a rig were taken at different times. In a single pair, a late view looks like a camera that
// rotated. A sequence shows the difference: if one view is late, the vertical disparity follows the motion of the picture.
#pragma once

#include <array>
#include <optional>

#include "geometry/pose_error.hpp"
#include "images/size.hpp"
#include "maps/image_motion.hpp"

namespace endosdk {

// Fits by how many frames a view is late. It fits a line to pairs of numbers: the rows by which matches lie lower, against the
// rows by which the content of the picture lay lower in the previous frame. Older frames fade.
class LagFit {
 public:
  void add(double moved_px, double rows_px);

  int frames() const { return frames_; }
  double lag() const;              // frames
  double lag_se() const;           // standard error of the lag; it allows for the correlation of neighbouring frames
  double usual_motion_px() const;  // root mean square of the motion per frame

 private:
  int frames_ = 0;
  double sum_ = 0.0, x_ = 0.0, y_ = 0.0, xx_ = 0.0, xy_ = 0.0, yy_ = 0.0;
};

// Watches one source. It takes every frame in order.
class Simultaneity {
 public:
  // Reserves memory for frames like this one, and forgets the previous frame.
  void make_room(const BrightnessPyramid& view);

  // Takes the left view; `view` is swapped with the memory of the previous frame. `row_px` is the number of rows of the frame
  // per row of the picture. Returns the vertical motion between the views, px of the frame. It is 0 if no motion is certain,
  // and empty while too little is known.
  std::optional<double> motion_between(BrightnessPyramid& view, double row_px, const PoseError& pose);

  // Whether the picture has moved on far enough, from the frame that was the first of its view to the latest one.
  bool new_view() const { return new_view_; }

  // A frame is missing: the next one tells nothing of the motion from one frame to the next.
  void skip() {
    has_former_ = false;
    new_view_ = true;
    former_rows_px_.reset();
  }

 private:
  // Adds the motion from one frame to the next, px of a picture of this width.
  void travel(const ImageMotion::Shift& shift, float outwards, int width);

  bool has_former_ = false;
  bool new_view_ = true;
  std::array<double, 3> travelled_{};  // since the first frame of the view, in widths: to the right, down and out of the middle
  BrightnessPyramid former_;
  ImageMotion motion_;
  LagFit right_;  // how late the right view is
  LagFit left_;   // how late the left view is, negative; it pairs the rows of a frame with the motion one frame later
  std::optional<double> former_rows_px_;
};

}  // namespace endosdk
