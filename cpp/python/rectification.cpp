// Rules for a rig's numbers, rectification, and the comparison of raw frames. Each function checks its arrays, releases the GIL
// where it works on pictures, and calls the core.
#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "frame_path/network_size.hpp"
#include "geometry/rig_rules.hpp"
#include "geometry/stereo_rectify.hpp"
#include "images/rectify.hpp"
#include "images/equal_blocks.hpp"
#include "images/interlacing.hpp"
#include "images/same_view.hpp"
#include "rigs.hpp"

namespace endosdk {
namespace {

using ViewTuple = std::tuple<std::string, Doubles, Doubles, Doubles, Doubles>;

CameraModel camera_model(const std::string& model) {
  if (model == "pinhole") return CameraModel::pinhole;
  if (model == "fisheye") return CameraModel::fisheye;
  reject("model", "must be pinhole or fisheye", model);
}

Camera camera(const std::string& model, const Doubles& matrix, const Doubles& distortion, const std::string& name) {
  Camera result;
  result.model = camera_model(model);
  const Mat3 k = numbers<9>(matrix, name + " matrix");
  require(k[1] == 0.0 && k[3] == 0.0 && k[6] == 0.0 && k[7] == 0.0 && k[8] == 1.0, name + " matrix",
          "must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]", "another form");
  result.fx = k[0];
  result.cx = k[2];
  result.fy = k[4];
  result.cy = k[5];
  const py::ssize_t count = distortion.size();
  const bool pinhole = result.model == CameraModel::pinhole;
  require(count == 0 || count == 4 || (pinhole && (count == 5 || count == 8)), name + " distortion",
          pinhole ? "must hold 0, 4, 5 or 8 coefficients" : "must hold 0 or 4 coefficients for a fisheye", count);
  std::copy_n(distortion.data(), count, result.distortion.begin());
  return result;
}

ViewGeometry view_geometry(const ViewTuple& view, const std::string& name) {
  const auto& [model, matrix, distortion, rotation, projection] = view;
  ViewGeometry result;
  result.camera = camera(model, matrix, distortion, name);
  result.rotation = numbers<9>(rotation, name + " rotation");
  result.projection = numbers<12>(projection, name + " projection");
  return result;
}

template <size_t Count>
Doubles matrix(const std::array<double, Count>& values) {
  Doubles result({py::ssize_t{3}, static_cast<py::ssize_t>(Count / 3)});
  std::copy(values.begin(), values.end(), result.mutable_data());
  return result;
}

py::tuple stereo_rectify_arrays(const std::string& model, const Doubles& k1, const Doubles& d1, const Doubles& k2,
                                const Doubles& d2, const Doubles& rotation, const Doubles& translation, int width,
                                int height, double alpha) {
  StereoRig rig;
  rig.left = camera(model, k1, d1, "left");
  rig.right = camera(model, k2, d2, "right");
  rig.rotation = numbers<9>(rotation, "rotation");
  rig.translation = numbers<3>(translation, "translation");
  rig.width = width;
  rig.height = height;
  const Rectification r = stereo_rectify(rig, alpha);
  return py::make_tuple(matrix(r.left_rotation), matrix(r.right_rotation), matrix(r.left_projection),
                        matrix(r.right_projection));
}

py::tuple rig_geometry(const RigNumbers& numbers, double alpha) {
  const Rectification r = rig_of(numbers).geometry(alpha).views;
  return py::make_tuple(matrix(r.left_rotation), matrix(r.right_rotation), matrix(r.left_projection),
                        matrix(r.right_projection));
}

py::tuple undistort_map(const std::string& model, const Doubles& k, const Doubles& d, const Doubles& rotation,
                        const Doubles& projection, int width, int height) {
  require(width >= 1 && height >= 1, "size", "must be positive", std::to_string(width) + "x" + std::to_string(height));
  const ViewGeometry view = view_geometry({model, k, d, rotation, projection}, "camera");
  check_view(view, "camera");
  const SourceMap map(view);
  py::array_t<float> map_x({height, width});
  py::array_t<float> map_y({height, width});
  float* x_out = map_x.mutable_data();
  float* y_out = map_y.mutable_data();
  {
    const py::gil_scoped_release release;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const Point p = map.at(x, y).pixel;
        *x_out++ = static_cast<float>(p.x);
        *y_out++ = static_cast<float>(p.y);
      }
    }
  }
  return py::make_tuple(map_x, map_y);
}

Rectifier make_rectifier(int width, int height, int out_width, int out_height, const ViewTuple& left,
                         const ViewTuple& right, bool whole_border) {
  const ViewGeometry left_view = view_geometry(left, "left");
  const ViewGeometry right_view = view_geometry(right, "right");
  const py::gil_scoped_release release;
  const Border border = whole_border ? Border::whole : Border::fading;
  return {{width, height}, {out_width, out_height}, left_view, right_view, border};
}

// The pair of frames and outputs that rectify and pack share.
struct Pair {
  ImageView left, right;
  PlanarView out_left, out_right;
  ChannelOrder order;

  Pair(const py::array& l, const py::array& r, py::array& out_l, py::array& out_r, const std::string& o)
      : left(image_view(l, "left")),
        right(image_view(r, "right")),
        out_left(planar_output(out_l, "out_left")),
        out_right(planar_output(out_r, "out_right")),
        order(channel_order(o)) {}
};

void rectify_arrays(const Rectifier& rectifier, const py::array& left, const py::array& right, py::array& out_left,
                    py::array& out_right, const std::string& order) {
  const Pair pair(left, right, out_left, out_right, order);
  thread_local RectifyScratch scratch;  // per thread, because a rectifier may serve several threads
  const py::gil_scoped_release release;
  rectifier.rectify(pair.left, pair.right, pair.out_left, pair.out_right, pair.order, scratch);
}

std::pair<double, double> displacement_of_arrays(const py::array& left, const py::array& right) {
  const ImageView a = image_view(left, "left");
  const ImageView b = image_view(right, "right");
  const py::gil_scoped_release release;
  const FrameDisplacement apart = displacement_of_frames(a, b);
  return {apart.textured, apart.rest};
}

double combed_share_of_array(const py::array& frame) {
  const ImageView view = image_view(frame, "frame");
  const py::gil_scoped_release release;
  return combed_share(view);
}

py::array equal_blocks_of_arrays(const py::array& left, const py::array& right) {
  const ImageView a = image_view(left, "left");
  const ImageView b = image_view(right, "right");
  require(a.size() == b.size() && a.channels == b.channels, "right", "must have the shape of left", b.size());
  EqualBlocks blocks;
  {
    const py::gil_scoped_release release;
    blocks.compare(a, b);
  }
  return py::array_t<uint8_t>({blocks.size().height, blocks.size().width}, blocks.marks().data());
}

void pack_arrays(const py::array& left, const py::array& right, py::array& out_left, py::array& out_right,
                 const std::string& order) {
  const Pair pair(left, right, out_left, out_right, order);
  const py::gil_scoped_release release;
  pack(pair.left, pair.right, pair.out_left, pair.out_right, pair.order);
}

py::array valid_mask(const Rectifier& rectifier, const std::vector<uint8_t>& mask) {
  const Size size = rectifier.rectified_size();
  return py::array_t<uint8_t>({size.height, size.width}, mask.data());
}

// A check of `Count` numbers, in the form in which Python calls it.
template <size_t Count>
auto check_of(void (*check)(const double* values, const char* argument)) {
  return [check](const Doubles& values, const std::string& name) { check(numbers<Count>(values, name.c_str()).data(), name.c_str()); };
}

}  // namespace

void bind_rectification(py::module_& m) {
  using py::arg;
  m.def(
      "check_field_of_view",
      [](const Doubles& field, int width, int height, const std::string& name) {
        check_field_of_view(numbers<4>(field, name.c_str()).data(), width, height, name.c_str());
      },
      arg("field"), arg("width"), arg("height"), arg("name"), "Refuse a field of view that is no ellipse in such a frame.");
  m.def("check_camera_matrix", check_of<9>(check_camera_matrix), arg("matrix"), arg("name"), "Refuse a camera matrix [3, 3] that is none, or has skew.");
  m.def(
      "check_distortion",
      [](const Doubles& coefficients, bool fisheye, const std::string& name) {
        check_distortion(coefficients.data(), static_cast<int>(coefficients.size()), fisheye, name.c_str());
      },
      arg("coefficients"), arg("fisheye"), arg("name"), "Refuse distortion coefficients of a number that the model does not know.");
  m.def("check_rotation", check_of<9>(check_rotation), arg("rotation"), arg("name"), "Refuse a matrix [3, 3] that is no rotation.");
  m.def("check_translation", check_of<3>(check_translation), arg("translation"), arg("name"), "Refuse a translation [3] that does not lead to a camera on the right.");
  m.def("stereo_rectify", &stereo_rectify_arrays, arg("model"), arg("K1"), arg("D1"), arg("K2"), arg("D2"), arg("R"),
        arg("T"), arg("width"), arg("height"), arg("alpha"),
        "Rectifying rotations R1, R2 and projections P1, P2 of a rig, as OpenCV computes them.");
  m.def("rig_geometry", &rig_geometry, arg("rig"), arg("alpha"),
        "R1, R2, P1, P2 of the rectified pair of a rig.");
  m.def(
      "is_rectified", [](const RigNumbers& rig) { return stands_rectified(calibration_of(rig)); }, arg("rig"),
      "Whether pictures of a rig need no rectification.");
  m.def(
      "network_size_of",
      [](int width, int height, int inference_width) {
        const Size size = network_size_of({width, height}, inference_width);
        return std::make_tuple(size.width, size.height);
      },
      arg("width"), arg("height"), arg("inference_width"), "Size at which the network sees a frame when the caller sets none.");
  m.def(
      "rotation_matrix", [](const Doubles& vector) { return matrix(rotation_matrix(numbers<3>(vector, "vector"))); },
      arg("vector"), "Rotation matrix of an axis times an angle, radians.");
  m.def("undistort_map", &undistort_map, arg("model"), arg("K"), arg("D"), arg("R"), arg("P"), arg("width"),
        arg("height"), "Raw x and y of every rectified pixel, float32; NaN for rays that point backwards.");
  py::class_<Rectifier>(m, "Rectifier", "Turns raw pairs into rectified planar RGB; immutable once built.")
      .def(py::init(&make_rectifier), arg("width"), arg("height"), arg("out_width"), arg("out_height"), arg("left"),
           arg("right"), arg("whole_border") = false)
      .def("rectify", &rectify_arrays, arg("left").noconvert(), arg("right").noconvert(), arg("out_left").noconvert(),
           arg("out_right").noconvert(), arg("order"), "Rectify one pair into given arrays.")
      .def_property_readonly("valid_left", [](const Rectifier& r) { return valid_mask(r, r.valid_left()); })
      .def_property_readonly("valid_right", [](const Rectifier& r) { return valid_mask(r, r.valid_right()); });
  m.def("pack", &pack_arrays, arg("left").noconvert(), arg("right").noconvert(), arg("out_left").noconvert(),
        arg("out_right").noconvert(), arg("order"), "Rewrite an already rectified pair as padded planar RGB.");
  m.def("combed_share", &combed_share_of_array, arg("frame").noconvert(),
        "Share of the tiles of a raw frame in which neighbouring rows differ clearly more than rows two apart.");
  m.def("displacement_of_frames", &displacement_of_arrays, arg("left").noconvert(), arg("right").noconvert(),
        "How far apart two frames show their texture, thousandths of the width: in tiles with more texture, and in the rest.");
  m.def("equal_blocks", &equal_blocks_of_arrays, arg("left").noconvert(), arg("right").noconvert(),
        "Blocks in which both frames show the same: 0 differs, 1 equal, 2 equal steps along the rows. All are 0 if none is 2.");
  m.attr("farthest_displacement") = farthest_displacement;
  m.attr("displacement_of_one_view") = displacement_of_one_view;
  m.attr("rest_of_one_view") = rest_of_one_view;
}

}  // namespace endosdk
