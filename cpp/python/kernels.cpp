// Single kernels and stages, for tests and studies. Each function checks its arrays, releases the GIL and calls the core.
#include <algorithm>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "frame_path/network_size.hpp"
#include "frame_path/simultaneity.hpp"
#include "geometry/rig_rules.hpp"
#include "geometry/stereo_rectify.hpp"
#include "images/rectify.hpp"
#include "images/same_view.hpp"
#include "kernels/kernels.hpp"
#include "maps/coarse_match.hpp"
#include "maps/repeated_pattern.hpp"
#include "maps/postprocess.hpp"
#include "maps/temporal_filter.hpp"
#include "platform/threads.hpp"

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

// A field of a call's arguments, or `otherwise` if it is missing.
template <typename Value>
Value field(const py::dict& fields, const char* name, Value otherwise) {
  return fields.contains(name) ? py::cast<Value>(fields[name]) : otherwise;
}

// Refuses unknown names, so that no argument of the caller is ignored.
void check_names(const py::dict& fields, const char* argument, std::initializer_list<const char*> known) {
  for (const auto& item : fields) {
    const auto name = py::cast<std::string>(item.first);
    const bool is_known = std::any_of(known.begin(), known.end(), [&](const char* each) { return name == each; });
    require(is_known, argument, "must hold fields of PostprocessInput", name);
  }
}

py::array required_array(const py::dict& fields, const char* name) {
  require(fields.contains(name), name, "must be given", "nothing");
  return py::cast<py::array>(fields[name]);
}

Scale scale_of(const py::dict& fields, const char* name) {
  const auto [y, x] = field<std::pair<double, double>>(fields, name, {1.0, 1.0});
  return {y, x};
}

PlanarView read_only_planes(const OptionalArray& array, const char* name) {
  // The images are only read; the view's type is shared with outputs.
  return array ? planar_view(*array, const_cast<void*>(array->data()), name) : PlanarView{};
}

// The maps of a call, in the order of map_fields.
py::tuple output_maps(const py::dict& fields) {
  py::list maps;
  size_t known = 0;
  for_each_map([&](const auto& each) {
    known += fields.contains(each.name) ? 1 : 0;
    maps.append(field<py::object>(fields, each.name, py::none()));
  });
  require(known == fields.size(), "out", "must hold maps that there are", Text(fields.size() - known, " others"));
  return maps;
}

// The post-processing stage alone, for tests and studies. The frame path fills the same structs.
int postprocess_arrays(const py::dict& fields, const py::dict& outputs) {
  check_names(fields, "fields",
              {"disparity", "confidence", "scale", "view_scale", "gain", "reach", "min_confidence", "max_candidate_disparity",
               "left", "right", "right_shift", "valid_left", "valid_right", "focal_px", "baseline_mm", "doffs",
               "min_depth_mm", "max_depth_mm", "pattern"});
  const FloatView first = float_view<float>(required_array(outputs, "disparity"), "disparity");
  check_grid(first, "out_disparity");
  PostprocessInput in;
  in.size = {first.width, first.height};
  const MapsOut maps = maps_out(output_maps(outputs), in.size);
  const py::array disparity = required_array(fields, "disparity");
  const py::array confidence = required_array(fields, "confidence");
  const auto left = field<OptionalArray>(fields, "left", std::nullopt);
  const auto right = field<OptionalArray>(fields, "right", std::nullopt);
  const auto valid_left = field<OptionalArray>(fields, "valid_left", std::nullopt);
  const auto valid_right = field<OptionalArray>(fields, "valid_right", std::nullopt);
  in.disparity = float_view<float>(disparity, "disparity");
  in.confidence = float_view<float>(confidence, "confidence");
  in.scale = scale_of(fields, "scale");
  in.view_scale = scale_of(fields, "view_scale");
  in.gain = field(fields, "gain", in.gain);
  in.reach = field(fields, "reach", in.reach);
  in.min_confidence = field(fields, "min_confidence", in.min_confidence);
  in.max_candidate_disparity = field(fields, "max_candidate_disparity", in.max_candidate_disparity);
  in.left = read_only_planes(left, "left");
  in.right = read_only_planes(right, "right");
  in.right_shift = field(fields, "right_shift", in.right_shift);
  in.valid_left = map_of<uint8_t>(valid_left, in.size, "valid_left");
  in.valid_right = map_of<uint8_t>(valid_right, in.size, "valid_right");
  in.geometry = {field(fields, "focal_px", 0.0), field(fields, "baseline_mm", 0.0), field(fields, "doffs", 0.0),
                 field(fields, "min_depth_mm", 0.0),
                 field(fields, "max_depth_mm", std::numeric_limits<double>::infinity())};
  if (fields.contains("pattern")) {
    const auto pattern = fields["pattern"].cast<std::array<double, 5>>();
    in.pattern = {pattern[0], pattern[1], pattern[2], pattern[3], pattern[4], true};
  }
  const py::gil_scoped_release release;
  thread_local PostprocessScratch scratch;  // kept between calls, as in a frame path
  return postprocess(in, maps, scratch);
}

// Applies a temporal filter to one frame. The disparity is filtered in place.
void smooth_arrays(TemporalFilter& filter, const py::array& left, std::pair<int, int> picture, py::array disparity,
                   const py::array& confidence, double cells_per_pixel) {
  const OptionalArray view = left;
  const PlanarView planes = read_only_planes(view, "left");
  check_planar(planes, picture.first, picture.second, "left");
  const MutableFloatView filtered = float_output(disparity, "disparity");
  const FloatView trusted = float_view<float>(confidence, "confidence");
  require(trusted.width == filtered.width && trusted.height == filtered.height, "confidence", "must have the size of disparity",
          shape_text(confidence));
  const py::gil_scoped_release release;
  filter.smooth({planes, {picture.first, picture.second}, filtered, trusted, {cells_per_pixel, cells_per_pixel}});
}

// The pose error from the vertical disparity of a matched pair, for tests: values, covariance, vertical disparity and its
// error.
py::object rig_error_of(const py::array& disparity, const py::array& confidence, const py::array& left, const py::array& right,
                        std::pair<int, int> picture, std::pair<double, double> frame, const std::array<double, 5>& pattern) {
  const FloatView found = float_view<float>(disparity, "disparity");
  const FloatView sure = float_view<float>(confidence, "confidence");
  const PlanarView views[] = {read_only_planes(left, "left"), read_only_planes(right, "right")};
  const Scale grid = {static_cast<double>(found.height) / views[0].height, static_cast<double>(found.width) / views[0].width};
  MatchedViews matched;
  RowDisparity rows;
  matched.compare(found, views[0], views[1], {picture.first, picture.second}, grid, {});
  const PosePattern shape = {pattern[0], pattern[1], pattern[2], pattern[3], pattern[4], true};
  return pose_tuple(rows.measure(matched, sure, grid, {frame.second, frame.first}, shape));
}

// The views of a pair, reduced as for the trust checks. The network's matches are not needed.
MatchedViews reduced_views(const py::array& left, const py::array& right, std::pair<int, int> picture) {
  const PlanarView views[] = {read_only_planes(left, "left"), read_only_planes(right, "right")};
  const float nowhere = 0.0f;
  MatchedViews matched;
  matched.compare({&nowhere, 1, 1}, views[0], views[1], {picture.first, picture.second}, {1.0 / views[0].height, 1.0 / views[0].width}, {});
  return matched;
}

// Coarse matching of a pair without the network, for tests: the gain in correlation from swapping the views, and the rows of
// brightness by which matches lie lower.
std::pair<double, double> coarse_match_of(const py::array& left, const py::array& right, std::pair<int, int> picture) {
  const MatchedViews views = reduced_views(left, right, picture);
  PatchSearch search;
  search.take(views);
  CoarseMatch match;
  match.measure(search, views);
  return {match.exchanged_gain(), match.rows_off()};
}

double share_of_rivals_in(const py::array& left, const py::array& right, std::pair<int, int> picture) {
  const MatchedViews views = reduced_views(left, right, picture);
  PatchSearch search;
  search.take(views);
  return share_of_rivals(search, views);
}

std::pair<double, double> lag_of(const std::vector<double>& moved_px, const std::vector<double>& rows_px) {
  require(moved_px.size() == rows_px.size(), "rows_px", "must be as many as moved_px", rows_px.size());
  LagFit fit;
  for (size_t i = 0; i < moved_px.size(); ++i) fit.add(moved_px[i], rows_px[i]);
  return {fit.lag(), fit.lag_se()};
}

void bind_settings(py::module_& m) {
  m.def("isa", [] { return std::string(kernels().name); }, "Instruction set in use: one of kernel_sets.");
  m.def("set_isa", [](const std::string& name) { choose_kernels(name.c_str()); }, py::arg("name"),
        "Use another instruction set, for tests and diagnostics.");
  py::list sets;
  for (int i = 0; kernel_set(i) != nullptr; ++i) sets.append(kernel_set(i));
  m.attr("kernel_sets") = py::tuple(sets);
  m.def("has_integer_units", &has_integer_units, "Whether this processor has vector instructions for 8-bit networks (AVX2, or dot products on ARM).");
  m.def("default_threads", &default_thread_count, "Cores that this process may use, but at most 8.");
  m.def("threads", &thread_count, "Threads that kernels called from this thread may use.");
  m.def("set_threads", &set_thread_count, py::arg("n"), "Set that number for the calling thread, 1 to 256.");
  m.def("reserve_threads", &reserve_threads, py::arg("n"), py::call_guard<py::gil_scoped_release>(),
        "Raise OutOfMemory unless the system can start so many further threads at a time.");
}

// A check of `Count` numbers, in the form in which Python calls it.
template <size_t Count>
auto check_of(void (*check)(const double* values, const char* argument)) {
  return [check](const Doubles& values, const std::string& name) { check(numbers<Count>(values, name.c_str()).data(), name.c_str()); };
}

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
  m.def("displacement_of_frames", &displacement_of_arrays, arg("left").noconvert(), arg("right").noconvert(),
        "How far apart two frames show their texture, thousandths of the width: in tiles with more texture, and in the rest.");
  m.attr("farthest_displacement") = farthest_displacement;
  m.attr("displacement_of_one_view") = displacement_of_one_view;
  m.attr("rest_of_one_view") = rest_of_one_view;
}

void bind_maps(py::module_& m) {
  using py::arg;
  m.def("resize_bilinear", &resize_arrays, arg("src"), arg("out"), arg("scale_y"), arg("scale_x"), arg("gain"),
        "Resize a map with half-pixel centres and multiply it by gain.");
  m.def("rig_error", &rig_error_of, arg("disparity"), arg("confidence"), arg("left").noconvert(), arg("right").noconvert(),
        arg("picture"), arg("frame"), arg("pattern"), "The pose error that explains what is left across the rows.");
  m.def("lag_of", &lag_of, arg("moved_px"), arg("rows_px"),
        "By how many frames the right view is late, and its standard error, from lists of one number a frame: the rows by "
        "which the picture's content lay lower in the frame before, and by which matches lie lower in the right view.");
  m.def("coarse_match", &coarse_match_of, arg("left").noconvert(), arg("right").noconvert(), arg("picture"),
        "What exchanging the views gains in correlation, and the rows by which matches lie lower.");
  m.def("share_of_rivals", &share_of_rivals_in, arg("left").noconvert(), arg("right").noconvert(), arg("picture"),
        "Share of the textured patches of the left view that match at two places of their row.");
  m.def("postprocess", &postprocess_arrays, arg("fields"), arg("out"),
        "Fill the full-size maps of one frame; returns the number of valid pixels.");
  py::class_<TemporalFilter>(m, "TemporalFilter", "Disparity of one camera's frames, made steady in time.")
      .def(py::init<>())
      .def("smooth", &smooth_arrays, arg("left").noconvert(), arg("picture"), arg("disparity").noconvert(),
           arg("confidence").noconvert(), arg("cells_per_pixel"));
}

}  // namespace

void bind_kernels(py::module_& m) {
  bind_settings(m);
  bind_rectification(m);
  bind_maps(m);
}

}  // namespace endosdk
