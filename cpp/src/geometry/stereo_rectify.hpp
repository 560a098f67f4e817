// Computes the rectified geometry of a calibrated rig, by OpenCV's conventions.
#pragma once

#include <array>

#include "geometry/camera.hpp"
#include "geometry/linear.hpp"

namespace endosdk {

using Mat34 = std::array<double, 12>;

// right_point = rotation * left_point + translation. All depths are in the unit of the translation.
struct StereoRig {
  Camera left;
  Camera right;
  Mat3 rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vec3 translation{};
  int width = 0;
  int height = 0;
};

// Rotations into the rectified coordinate frames, and projections from there to rectified pixels. Both projections share focal
// length and principal point. right_projection[3] is minus the focal length along x times the baseline.
struct Rectification {
  Mat3 left_rotation;
  Mat3 right_rotation;
  Mat34 left_projection;
  Mat34 right_projection;
};

// Equals cv2.stereoRectify(flags=CALIB_ZERO_DISPARITY, alpha=alpha) for pinhole rigs and cv2.fisheye.stereoRectify with
// balance=alpha for fisheye rigs. Alpha 0 shows only pixels that both views have, 1 keeps every source pixel. A negative alpha
// (pinhole only) keeps the mean focal length. The views must lie side by side. One exception, for alpha 0 and pinhole rigs: if
// OpenCV would enlarge the views more than 1.5 times, as those of cropped frames, the principal point moves instead.
Rectification stereo_rectify(const StereoRig& rig, double alpha);

// The numbers for one rectified view: the camera that took it, and the rectified geometry.
struct ViewGeometry {
  Camera camera;
  Mat3 rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Mat34 projection{};
};

void check_view(const ViewGeometry& view, const char* name);

// Maps rectified pixels to their positions in the raw image.
class SourceMap {
 public:
  explicit SourceMap(const ViewGeometry& view);

  struct Source {
    Point pixel;            // NaN for a ray that points backwards
    bool unfolded = false;  // the lens model is one-to-one here
  };
  Source at(double x, double y) const;

 private:
  Camera camera_;
  Mat3 to_ray_;
  double fold_squared_;
};

}  // namespace endosdk
