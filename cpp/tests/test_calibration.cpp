// Tests the geometry in C++: a rig with a known result, and inputs that must be refused.
#include <cmath>
#include <limits>

#include "geometry/stereo_rectify.hpp"
#include "check.hpp"

using namespace endosdk;

namespace {

StereoRig parallel_rig() {
  StereoRig rig;
  rig.left = rig.right = {CameraModel::pinhole, 800, 800, 479.5, 359.5, {}};
  rig.translation = {-5, 0, 0};
  rig.width = 960;
  rig.height = 720;
  return rig;
}

bool near(double a, double b) { return std::fabs(a - b) < 1e-9; }

void test_parallel_rig_stays() {
  const Rectification r = stereo_rectify(parallel_rig(), 0.0);
  CHECK(near(r.left_projection[0], 800) && near(r.left_projection[2], 479.5) && near(r.left_projection[6], 359.5));
  CHECK(near(r.right_projection[3], -4000));
  CHECK(near(r.left_rotation[0], 1) && near(r.left_rotation[1], 0));
}

void test_rows_agree_after_rectification() {
  StereoRig rig = parallel_rig();
  rig.rotation = rotation_matrix({0.02, -0.03, 0.01});
  rig.translation = {-5, 0.2, -0.1};
  const Rectification r = stereo_rectify(rig, 0.0);
  for (const Vec3 point : {Vec3{3, -4, 60}, Vec3{-10, 8, 90}, Vec3{0, 0, 40}}) {
    const Vec3 moved = multiply(rig.rotation, point);
    const Vec3 in_right = {moved[0] + rig.translation[0], moved[1] + rig.translation[1], moved[2] + rig.translation[2]};
    const Vec3 a = multiply(r.left_rotation, point);
    const Vec3 b = multiply(r.right_rotation, in_right);
    CHECK(near(a[1] / a[2], b[1] / b[2]));
    const double disparity = r.left_projection[0] * (a[0] / a[2] - b[0] / b[2]);
    CHECK(near(disparity, -r.right_projection[3] / a[2]));
  }
}

void test_projection_and_its_inverse() {
  for (const CameraModel model : {CameraModel::pinhole, CameraModel::fisheye}) {
    const Camera camera = {model, 700, 710, 480, 360, {-0.01, 0.002, 1e-4, -1e-4}};
    const Point back = unproject(camera, project(camera, {0.2, -0.1}));
    CHECK(std::fabs(back.x - 0.2) < 1e-6 && std::fabs(back.y + 0.1) < 1e-6);
    CHECK(std::isinf(fold_radius(camera)));
  }
}

void test_refusals() {
  StereoRig rig = parallel_rig();
  rig.translation = {0, -5, 0};
  CHECK(rejection([&] { stereo_rectify(rig, 0); }).rfind("translation: the cameras must lie side by side", 0) == 0);
  rig = parallel_rig();
  rig.left.fx = std::numeric_limits<double>::quiet_NaN();
  CHECK(rejection([&] { stereo_rectify(rig, 0); }) == "left matrix: every value must be finite; got nan");
  rig = parallel_rig();
  rig.right.model = CameraModel::fisheye;
  CHECK(rejection([&] { stereo_rectify(rig, 0); }).rfind("model: must be the same", 0) == 0);
}

}  // namespace

int main() {
  test_parallel_rig_stays();
  test_rows_agree_after_rectification();
  test_projection_and_its_inverse();
  test_refusals();
  return 0;
}
