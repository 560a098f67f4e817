// Single kernels and stages after the network, for tests and studies. Each function checks its arrays, releases the GIL and
// calls the core.
#include <algorithm>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "frame_path/simultaneity.hpp"
#include "kernels/kernels.hpp"
#include "maps/coarse_match.hpp"
#include "maps/repeated_pattern.hpp"
#include "maps/row_misfit.hpp"
#include "maps/postprocess.hpp"
#include "maps/temporal_filter.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

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

// Misfit of rests [bands, along] for tests: the share of parts that do not fit, and what is kept [down, across] or None.
std::pair<double, py::object> row_misfit_of(const py::array& rest, float least) {
  const FloatView seen = float_view<float>(rest, "rest");
  RowMisfit misfit;
  misfit.prepare(seen.height, seen.width);
  misfit.find({seen.data, seen.data + static_cast<ptrdiff_t>(seen.height) * seen.width}, least);
  const FloatView kept = misfit.kept();
  if (kept.data == nullptr) return {misfit.share(), py::none()};
  return {misfit.share(), py::array_t<float>({kept.height, kept.width}, kept.data)};
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

void bind_maps(py::module_& m) {
  using py::arg;
  m.def("resize_bilinear", &resize_arrays, arg("src"), arg("out"), arg("scale_y"), arg("scale_x"), arg("gain"),
        "Resize a map with half-pixel centres and multiply it by gain.");
  m.def("rig_error", &rig_error_of, arg("disparity"), arg("confidence"), arg("left").noconvert(), arg("right").noconvert(),
        arg("picture"), arg("frame"), arg("pattern"), "The pose error that explains what is left across the rows.");
  m.def("row_misfit", &row_misfit_of, arg("rest").noconvert(), arg("least"),
        "Share of the parts of a picture that no rig explains, and 0 there and beside them, 1 elsewhere; None below the limit.");
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
  bind_maps(m);
}

}  // namespace endosdk
