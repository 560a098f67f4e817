// The frame path and its streams as Python objects.
#include <algorithm>
#include <chrono>
#include <deque>
#include <memory>
#include <tuple>

#include "arrays.hpp"
#include "bindings.hpp"
#include "frame_path/stream.hpp"
#include "platform/threads.hpp"
#include "python_session.hpp"

namespace endosdk {
namespace {

using OptionalSize = std::optional<std::pair<int, int>>;
// disparity, confidence, reasons, depth, sigma
using Maps = std::tuple<py::array, py::array, py::array, OptionalArray, OptionalArray>;

MapsOut maps_of(Maps& maps, Size size) {
  auto& [disparity, confidence, reasons, depth, sigma] = maps;
  const MutableFloatView all = {nullptr, size.width, size.height};
  OptionalArray first = disparity;
  OptionalArray second = confidence;
  OptionalArray third = reasons;
  MapsOut out;
  out.disparity = map_output<float>(first, all, "disparity");
  out.confidence = map_output<float>(second, all, "confidence");
  out.reasons = map_output<uint8_t>(third, all, "reasons");
  out.depth = map_output<float>(depth, all, "depth");
  out.sigma = map_output<float>(sigma, all, "sigma");
  return out;
}

FramePair pair_of(const py::array& left, const py::array& right, ChannelOrder colour_order) {
  FramePair pair = {image_view(left, "left"), image_view(right, "right"), colour_order};
  if (pair.left.channels == 1) pair.order = ChannelOrder::gray;
  return pair;
}

// Lines about frames go to a logger that is silent until the host sets logging up.
void log_line(void*, int32_t level, const char* message) {
  const py::gil_scoped_acquire gil;
  try {
    const auto logger = py::module_::import("logging").attr("getLogger")("endosdk.frames");
    const char* method = level == ENDO_LOG_ERROR ? "error" : level == ENDO_LOG_WARNING ? "warning" : "info";
    logger.attr(method)("%s", message);
  } catch (py::error_already_set& error) {
    error.discard_as_unraisable("endosdk.frames");  // the line is lost; the frame is not
  }
}

// model, width, height, matrix and distortion of the left camera and of the right one, rotation, translation
using RigNumbers = std::tuple<std::string, int, int, Doubles, Doubles, Doubles, Doubles, Doubles, Doubles>;

Rig rig_of(const RigNumbers& given) {
  const auto& [model, width, height, left_matrix, left_distortion, right_matrix, right_distortion, rotation, translation] =
      given;
  endo_calibration rig{};
  rig.struct_size = sizeof rig;
  rig.camera_model = model == "fisheye" ? ENDO_FISHEYE : ENDO_PINHOLE;
  rig.width = width;
  rig.height = height;
  const auto copy = [](const auto& values, double* to) { std::copy(values.begin(), values.end(), to); };
  copy(numbers<9>(left_matrix, "left_matrix"), rig.left_matrix);
  copy(numbers<9>(right_matrix, "right_matrix"), rig.right_matrix);
  copy(numbers<9>(rotation, "rotation"), rig.rotation);
  copy(numbers<3>(translation, "translation"), rig.translation);
  const auto copy_distortion = [](const Doubles& values, const char* name, double* to) {
    require(values.size() <= 8, name, "must hold at most 8 coefficients", values.size());
    std::copy_n(values.data(), values.size(), to);
    return static_cast<int32_t>(values.size());
  };
  rig.left_distortion_count = copy_distortion(left_distortion, "left_distortion", rig.left_distortion);
  rig.right_distortion_count = copy_distortion(right_distortion, "right_distortion", rig.right_distortion);
  return Rig(rig);
}

py::array_t<uint8_t> new_picture(Size size) { return py::array_t<uint8_t>({size.height, size.width, 3}); }

// A stream with the maps of the frames in flight, which must outlive them.
class PythonStream {
 public:
  PythonStream(std::unique_ptr<Stream> stream, ChannelOrder order) : stream_(std::move(stream)), order_(order) {}

  ~PythonStream() {
    const py::gil_scoped_release release;  // threads that are to end may need it
    stream_->close();
  }

  int lanes() const { return stream_->lanes(); }

  bool wait_for_room() {
    const py::gil_scoped_release release;
    return stream_->wait_for_room();
  }

  void submit(const py::array& left, const py::array& right, const py::object& maps) {
    const FramePair pair = pair_of(left, right, order_);
    Maps arrays = py::cast<Maps>(maps);
    const MapsOut out = maps_of(arrays, stream_->frame_size());
    in_flight_.push_back(maps);
    try {
      const py::gil_scoped_release release;
      stream_->submit(pair, out, nullptr);
    } catch (...) {
      in_flight_.pop_back();
      throw;
    }
  }

  py::object receive() {
    while (!wait()) {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
    std::optional<Stream::Answer> answer;
    {
      const py::gil_scoped_release release;
      answer = stream_->receive();
    }
    if (!answer) return py::none();
    const py::object maps = in_flight_.front();
    in_flight_.pop_front();
    if (answer->error) std::rethrow_exception(answer->error);
    return py::make_tuple(answer->report, maps);
  }

  void end() {
    const py::gil_scoped_release release;
    stream_->end();
  }

  void close() {
    const py::gil_scoped_release release;
    stream_->close();
  }

 private:
  bool wait() {
    const py::gil_scoped_release release;
    return stream_->wait_for_answer(std::chrono::milliseconds(100));
  }

  std::unique_ptr<Stream> stream_;
  ChannelOrder order_;
  std::deque<py::object> in_flight_;
};

// Checked settings, made before a model is read.
struct PythonSettings {
  ChannelOrder order;
  FramePathSettings rest;

  PythonSettings(const std::string& channel_order_name, int threads, OptionalSize network, double min_confidence,
                 std::pair<double, double> depth_range_mm, double deadline_ms)
      : order(channel_order(channel_order_name)) {
    rest.threads = threads;
    if (network) rest.network = Size{network->first, network->second};
    rest.limits.min_confidence = min_confidence;
    std::tie(rest.limits.min_depth_mm, rest.limits.max_depth_mm) = depth_range_mm;
    rest.deadline_ms = deadline_ms;
    rest.log = {log_line, nullptr, ENDO_LOG_WARNING};
    check_settings(rest);
    if (rest.threads == 0) rest.threads = default_thread_count();
  }
};

// What belongs to one DepthEstimator.
class PythonFramePath {
 public:
  PythonFramePath(py::object session, const PythonSettings& settings)
      : order_(settings.order),
        path_(std::make_shared<FramePath>(std::make_shared<PythonSession>(std::move(session)), settings.rest)) {}

  FrameReport predict(const py::array& left, const py::array& right, Maps maps) {
    const FramePair pair = pair_of(left, right, order_);
    check_pair(pair);
    const MapsOut out = maps_of(maps, pair.size());
    const py::gil_scoped_release release;
    return path_->predict(pair, out);
  }

  std::unique_ptr<PythonStream> stream(int width, int height) {
    std::unique_ptr<Stream> opened;
    {
      const py::gil_scoped_release release;
      opened = path_->stream({width, height});
    }
    return std::make_unique<PythonStream>(std::move(opened), order_);
  }

  py::tuple rectify(const py::array& left, const py::array& right) {
    const FramePair pair = pair_of(left, right, order_);
    check_pair(pair);
    auto out_left = new_picture(pair.size());
    auto out_right = new_picture(pair.size());
    uint8_t* const to_left = out_left.mutable_data();
    uint8_t* const to_right = out_right.mutable_data();
    const auto capacity = static_cast<size_t>(out_left.size());
    {
      const py::gil_scoped_release release;
      path_->rectify(pair, to_left, to_right, capacity);
    }
    return py::make_tuple(out_left, out_right);
  }

  py::tuple rectified() {
    Size size;
    {
      const py::gil_scoped_release release;
      size = path_->rectified_size();
    }
    auto left = new_picture(size);
    auto right = new_picture(size);
    uint8_t* const to_left = left.mutable_data();
    uint8_t* const to_right = right.mutable_data();
    const auto capacity = static_cast<size_t>(left.size());
    {
      const py::gil_scoped_release release;
      path_->rectified(to_left, to_right, capacity);
    }
    return py::make_tuple(left, right);
  }

  FramePath& path() { return *path_; }

 private:
  ChannelOrder order_;
  std::shared_ptr<FramePath> path_;
};

// The rectified views of one pair at its own size.
py::tuple rectified_views(const py::array& left, const py::array& right, const RigNumbers& numbers) {
  const FramePair pair = pair_of(left, right, ChannelOrder::rgb);
  check_pair(pair);
  const Size size = pair.size();
  const Rig rig = rig_of(numbers);
  const RectifyStage stage(size, &rig, size, [] {});
  const size_t view = size_t{3} * static_cast<size_t>(size.width) * static_cast<size_t>(size.height);
  std::vector<uint8_t> planes(2 * view);
  const PlanarView l = {planes.data(), size.width, size.height};
  const PlanarView r = {planes.data() + view, size.width, size.height};
  RectifyScratch scratch;
  stage(pair.left, pair.right, l, r, pair.order, scratch);
  auto out_left = new_picture(size);
  auto out_right = new_picture(size);
  copy_interleaved(l, size, out_left.mutable_data());
  copy_interleaved(r, size, out_right.mutable_data());
  return py::make_tuple(out_left, out_right);
}

void bind_report(py::module_& m) {
  py::class_<FrameReport>(m, "FrameReport", "What is said of one frame besides its maps.")
      .def_readonly("frame", &FrameReport::frame)
      .def_readonly("valid_share", &FrameReport::valid_share)
      .def_readonly("status", &FrameReport::quality)
      .def_readonly("rectify_ms", &FrameReport::rectify_ms)
      .def_readonly("session_ms", &FrameReport::session_ms)
      .def_readonly("postprocess_ms", &FrameReport::postprocess_ms)
      .def_readonly("total_ms", &FrameReport::total_ms)
      .def_readonly("late", &FrameReport::late);
}

void bind_stream(py::module_& m) {
  py::class_<PythonStream>(m, "Stream", "Frames in flight; one thread may submit while another receives.")
      .def_property_readonly("lanes", &PythonStream::lanes)
      .def("wait_for_room", &PythonStream::wait_for_room)
      .def("submit", &PythonStream::submit, py::arg("left").noconvert(), py::arg("right").noconvert(), py::arg("maps"))
      .def("receive", &PythonStream::receive)
      .def("end", &PythonStream::end)
      .def("close", &PythonStream::close);
}

}  // namespace

// No lock of the core is waited for with the GIL in hand: who holds it may be waiting for the GIL, to run the network or to
// free what Python owns.
void bind_frame_path(py::module_& m) {
  using py::arg;
  using Path = PythonFramePath;
  using release = py::call_guard<py::gil_scoped_release>;
  bind_report(m);
  bind_stream(m);
  m.def("rectified_views", &rectified_views, arg("left").noconvert(), arg("right").noconvert(), arg("rig"));
  py::class_<PythonSettings>(m, "FramePathSettings", "What a host may choose of a frame path, checked.")
      .def(py::init<const std::string&, int, OptionalSize, double, std::pair<double, double>, double>(),
           arg("channel_order"), arg("threads"), arg("network_size"), arg("min_confidence"), arg("depth_range_mm"),
           arg("deadline_ms"))
      .def_property_readonly("threads", [](const PythonSettings& s) { return s.rest.threads; });
  py::class_<Path>(m, "FramePath", "The whole way of a frame around a session that Python brings.")
      .def(py::init<py::object, const PythonSettings&>(), arg("session"), arg("settings"))
      .def(
          "set_calibration",
          [](Path& p, const RigNumbers& numbers) {
            Rig rig = rig_of(numbers);
            const py::gil_scoped_release unlocked;
            p.path().set_calibration(std::move(rig));
          },
          arg("rig"))
      .def("predict", &Path::predict, arg("left").noconvert(), arg("right").noconvert(), arg("maps"))
      .def("stream", &Path::stream, arg("width"), arg("height"))
      .def("rectify", &Path::rectify, arg("left").noconvert(), arg("right").noconvert())
      .def("rectified", &Path::rectified)
      .def("prepare", [](Path& p, int width, int height) { p.path().prepare({width, height}); }, arg("width"),
           arg("height"), release())
      .def("cancel", [](Path& p) { p.path().cancel(); }, release())
      .def("self_test", [](Path& p) { p.path().self_test(); }, release())
      .def("close", [](Path& p) { p.path().close(); }, release())
      .def("nearest_depth_mm", [](Path& p) { return p.path().nearest_depth_mm(); }, release())
      .def("diagnostics", [](Path& p) { return p.path().diagnostics().done(); }, release());
}

}  // namespace endosdk
