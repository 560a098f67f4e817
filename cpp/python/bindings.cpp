// The Python module endosdk._core: converts and checks arrays, releases the GIL, calls the core. Nothing else.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <tuple>

#include "geometry/stereo_rectify.hpp"
#include "platform/errors.hpp"
#include "images/image.hpp"
#include "kernels/kernels.hpp"
#include "frame_path/network_size.hpp"
#include "maps/postprocess.hpp"
#include "images/rectify.hpp"
#include "images/resize.hpp"
#include "platform/threads.hpp"

namespace py = pybind11;

namespace endosdk {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using OptionalArray = std::optional<py::array>;
using ViewTuple = std::tuple<std::string, Doubles, Doubles, Doubles, Doubles>;

std::string shape_text(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t i = 0; i < array.ndim(); ++i) text += (i ? ", " : "") + std::to_string(array.shape(i));
  return text + ")";
}

int side(py::ssize_t length, const char* name) {
  require(length <= std::numeric_limits<int>::max() / 4, name, "is too large", length);
  return static_cast<int>(length);
}

template <typename Type>
void require_type(const py::array& array, const char* name) {
  require(py::isinstance<py::array_t<Type>>(array), name, "must be " + std::string(py::str(py::dtype::of<Type>())),
          std::string(py::str(array.dtype())));
}

void require_contiguous(const py::array& array, const char* name) {
  require((array.flags() & py::array::c_style) != 0, name, "must be C-contiguous", "strides of another order");
}

template <typename Type>
FloatView float_view(const py::array& array, const char* name) {
  require_type<Type>(array, name);
  require(array.ndim() == 2, name, "must have shape [height, width]", shape_text(array));
  require_contiguous(array, name);
  return {static_cast<const float*>(array.data()), side(array.shape(1), name), side(array.shape(0), name)};
}

// The memory of an array that the caller wants written.
void* writable(py::array& array, const char* name) {
  require(array.writeable(), name, "must be writable", "a read-only array");
  return array.mutable_data();
}

MutableFloatView float_output(py::array& array, const char* name) {
  const FloatView view = float_view<float>(array, name);
  return {static_cast<float*>(writable(array, name)), view.width, view.height};
}

// An optional map that must have the size of the outputs; null when it is None.
template <typename Type>
const Type* map_of(const OptionalArray& array, const MutableFloatView& size, const char* name) {
  if (!array) return nullptr;
  require_type<Type>(*array, name);
  require(array->ndim() == 2 && array->shape(0) == size.height && array->shape(1) == size.width, name,
          "must have the shape of out_disparity", shape_text(*array));
  require_contiguous(*array, name);
  return static_cast<const Type*>(array->data());
}

template <typename Type>
Type* map_output(OptionalArray& array, const MutableFloatView& size, const char* name) {
  if (map_of<Type>(array, size, name) == nullptr) return nullptr;
  return static_cast<Type*>(writable(*array, name));
}

ImageView image_view(const py::array& array, const char* name) {
  require_type<uint8_t>(array, name);
  const bool flat = array.ndim() == 2;
  require(flat || array.ndim() == 3, name, "must have shape [height, width, channels]", shape_text(array));
  const int channels = flat ? 1 : side(array.shape(2), name);
  const bool packed = (array.shape(1) <= 1 || array.strides(1) == channels) &&
                      (flat || channels <= 1 || array.strides(2) == 1);
  require(packed || array.size() == 0, name, "pixels of a row must be contiguous", "other strides");
  return {static_cast<const uint8_t*>(array.data()), side(array.shape(1), name), side(array.shape(0), name), channels,
          array.strides(0)};
}

PlanarView planar_view(const py::array& array, void* data, const char* name) {
  require_type<uint8_t>(array, name);
  require(array.ndim() == 3 && array.shape(0) == 3, name, "must have shape [3, height, width]", shape_text(array));
  require_contiguous(array, name);
  return {static_cast<uint8_t*>(data), side(array.shape(2), name), side(array.shape(1), name)};
}

PlanarView planar_output(py::array& array, const char* name) { return planar_view(array, writable(array, name), name); }

ChannelOrder channel_order(const std::string& order) {
  if (order == "rgb") return ChannelOrder::rgb;
  if (order == "bgr") return ChannelOrder::bgr;
  if (order == "gray") return ChannelOrder::gray;
  reject("order", "must be rgb, bgr or gray", order);
}

CameraModel camera_model(const std::string& model) {
  if (model == "pinhole") return CameraModel::pinhole;
  if (model == "fisheye") return CameraModel::fisheye;
  reject("model", "must be pinhole or fisheye", model);
}

template <size_t Count>
std::array<double, Count> numbers(const Doubles& array, const std::string& name) {
  require(array.size() == static_cast<py::ssize_t>(Count), name, "must hold " + std::to_string(Count) + " numbers",
          array.size());
  std::array<double, Count> result;
  std::copy_n(array.data(), Count, result.begin());
  return result;
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
  thread_local RectifyScratch scratch;  // a rectifier may serve several threads
  const py::gil_scoped_release release;
  rectifier.rectify(pair.left, pair.right, pair.out_left, pair.out_right, pair.order, scratch);
}

bool same_pixel_arrays(const py::array& left, const py::array& right) {
  const ImageView a = image_view(left, "left");
  const ImageView b = image_view(right, "right");
  const py::gil_scoped_release release;
  return same_pixels(a, b);
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

void resize_arrays(const py::array& source, py::array& out, double scale_y, double scale_x, float gain) {
  const FloatView from = float_view<float>(source, "src");
  const MutableFloatView to = float_output(out, "out");
  const py::gil_scoped_release release;
  resize_bilinear(from, to, {scale_y, scale_x}, gain);
}

int postprocess_arrays(const py::array& disparity, const py::array& confidence, double scale_y, double scale_x,
                       float gain, py::array& out_disparity, py::array& out_confidence, py::array& out_reasons,
                       const OptionalArray& image, const OptionalArray& valid_left, const OptionalArray& valid_right,
                       float min_confidence, OptionalArray out_depth, OptionalArray out_sigma, double focal_px,
                       double baseline_mm, double doffs, double min_depth_mm, double max_depth_mm, double image_scale_y,
                       double image_scale_x, double max_candidate_disparity, const OptionalArray& right_image, bool same_frames,
                       double right_shift) {
  PostprocessOutput out;
  out.disparity = float_output(out_disparity, "out_disparity");
  const MutableFloatView& size = out.disparity;
  OptionalArray confidence_map = out_confidence;
  OptionalArray reasons_map = out_reasons;
  out.confidence = {map_output<float>(confidence_map, size, "out_confidence"), size.width, size.height};
  out.reasons = map_output<uint8_t>(reasons_map, size, "out_reasons");
  out.depth = map_output<float>(out_depth, size, "out_depth");
  out.sigma = map_output<float>(out_sigma, size, "out_sigma");

  PostprocessInput in;
  in.disparity = float_view<float>(disparity, "disparity");
  in.confidence = float_view<float>(confidence, "confidence");
  in.scale = {scale_y, scale_x};
  in.gain = gain;
  in.min_confidence = min_confidence;
  in.max_candidate_disparity = max_candidate_disparity;
  // The images are only read; the view's type is shared with outputs.
  if (image) in.left = planar_view(*image, const_cast<void*>(image->data()), "image");
  if (right_image) in.right = planar_view(*right_image, const_cast<void*>(right_image->data()), "right_image");
  in.same_frames = same_frames;
  in.right_shift = right_shift;
  in.view_scale = {image_scale_y, image_scale_x};
  in.valid_left = map_of<uint8_t>(valid_left, size, "valid_left");
  in.valid_right = map_of<uint8_t>(valid_right, size, "valid_right");
  in.geometry = {focal_px, baseline_mm, doffs, min_depth_mm, max_depth_mm};
  const py::gil_scoped_release release;
  return postprocess(in, out);
}

void bind_settings(py::module_& m) {
  m.attr("version") = ENDOSDK_VERSION;
  m.attr("range_margin") = range_margin;
  m.def("isa", [] { return std::string(kernels().name); }, "Instruction set in use: avx512, avx2 or plain.");
  m.def("set_isa", [](const std::string& name) { choose_kernels(name.c_str()); }, py::arg("name"),
        "Use another instruction set, for tests and diagnostics.");
  m.def("has_integer_units", &has_integer_units, "Whether this processor has vector instructions for 8-bit networks (AVX2).");
  m.def("default_threads", &default_thread_count, "Cores that this process may use, but at most 8.");
  m.def("threads", &thread_count, "Threads that kernels called from this thread may use.");
  m.def("set_threads", &set_thread_count, py::arg("n"), "Set that number for the calling thread, 1 to 256.");
}

void bind_rectification(py::module_& m) {
  using py::arg;
  m.def("stereo_rectify", &stereo_rectify_arrays, arg("model"), arg("K1"), arg("D1"), arg("K2"), arg("D2"), arg("R"),
        arg("T"), arg("width"), arg("height"), arg("alpha"),
        "Rectifying rotations R1, R2 and projections P1, P2 of a rig, as OpenCV computes them.");
  m.def(
      "network_size_of",
      [](int width, int height, int inference_width) {
        const Size size = network_size_of({width, height}, inference_width);
        return std::make_tuple(size.width, size.height);
      },
      arg("width"), arg("height"), arg("inference_width"), "Size at which the network sees a frame when the caller sets none.");
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
  m.def("same_pixels", &same_pixel_arrays, arg("left").noconvert(), arg("right").noconvert(),
        "Whether two frames hold the same bytes.");
}

void bind_maps(py::module_& m) {
  using py::arg;
  m.def("resize_bilinear", &resize_arrays, arg("src"), arg("out"), arg("scale_y"), arg("scale_x"), arg("gain"),
        "Resize a map with half-pixel centres and multiply it by gain.");
  m.def("postprocess", &postprocess_arrays, arg("disparity"), arg("confidence"), arg("scale_y"), arg("scale_x"),
        arg("gain"), arg("out_disparity"), arg("out_confidence"), arg("out_reasons"), arg("image"), arg("valid_left"),
        arg("valid_right"), arg("min_confidence"), arg("out_depth") = py::none(), arg("out_sigma") = py::none(),
        arg("focal_px") = 0.0, arg("baseline_mm") = 0.0, arg("doffs") = 0.0, arg("min_depth_mm") = 0.0,
        arg("max_depth_mm") = std::numeric_limits<double>::infinity(), arg("image_scale_y") = 1.0,
        arg("image_scale_x") = 1.0, arg("max_candidate_disparity") = 0.0, arg("right_image") = py::none(), arg("same_frames") = false, arg("right_shift") = 0.0,
        "Fill the full-size maps of one frame; returns the number of usable pixels.");
}

}  // namespace
}  // namespace endosdk

PYBIND11_MODULE(_core, m) {
  m.doc() = "Compiled kernels of endosdk. Private: use the Python package instead.";
  endosdk::bind_settings(m);
  endosdk::bind_rectification(m);
  endosdk::bind_maps(m);
}
