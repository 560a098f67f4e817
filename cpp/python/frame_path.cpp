// The frame path and its streams as Python objects.
#include <algorithm>
#include <chrono>
#include <deque>
#include <memory>
#include <tuple>

#include "arrays.hpp"
#include "bindings.hpp"
#include "frame_path/network_size.hpp"
#include "frame_path/stream.hpp"
#include "frame_path/working_distance.hpp"
#include "platform/threads.hpp"
#include "python_session.hpp"
#include "rigs.hpp"

namespace endosdk {
namespace {

using OptionalSize = std::optional<std::pair<int, int>>;

FramePair pair_of(const py::array& left, const py::array& right, ChannelOrder colour_order) {
  FramePair pair = {image_view(left, "left"), image_view(right, "right"), colour_order};
  if (pair.left.channels == 1) pair.order = ChannelOrder::gray;
  return pair;
}

// Lines about frames go to a logger that is silent until the host configures logging.
constexpr char frame_logger[] = "endosdk.frames";
constexpr char rig_logger[] = "endosdk.rigs";

template <const char* logger_name>
void log_line(void*, int32_t level, const char* message) {
  const py::gil_scoped_acquire gil;
  try {
    const auto logger = py::module_::import("logging").attr("getLogger")(logger_name);
    const char* method = level == ENDO_LOG_ERROR ? "error" : level == ENDO_LOG_WARNING ? "warning" : "info";
    logger.attr(method)("%s", message);
  } catch (py::error_already_set& error) {
    error.discard_as_unraisable(logger_name);  // only the line is lost, not the result
  }
}

py::array_t<uint8_t> new_picture(Size size) { return py::array_t<uint8_t>({size.height, size.width, 3}); }

// A stream, and the maps of its frames in flight. The maps must outlive these frames.
class PythonStream {
 public:
  PythonStream(std::unique_ptr<Stream> stream, ChannelOrder order) : stream_(std::move(stream)), order_(order) {}

  ~PythonStream() {
    if (!stream_->process().is_this()) {
      static_cast<void>(stream_.release());  // in a forked child, the threads that hold its locks do not exist
      return;
    }
    const py::gil_scoped_release release;  // threads may need the GIL to end
    stream_->close();
  }

  int lanes() const { return stream_->lanes(); }

  bool wait_for_room() {
    const py::gil_scoped_release release;
    return stream_->wait_for_room();
  }

  void submit(const py::array& left, const py::array& right, const py::tuple& maps, int64_t stamp_ns) {
    const Clock::time_point asked = Clock::now();
    FramePair pair = pair_of(left, right, order_);
    pair.stamp_ns = stamp_ns;
    const MapsOut out = maps_out(maps, stream_->frame_size());
    in_flight_.push_back(maps);
    try {
      const py::gil_scoped_release release;
      stream_->submit(pair, out, nullptr, asked);
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

  void follow_rig() { stream_->follow_rig(); }

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

// Settings. They are checked before a model is read.
struct PythonSettings {
  ChannelOrder order;
  FramePathSettings rest;

  PythonSettings(const std::string& channel_order_name, int threads, OptionalSize network, double min_confidence,
                 std::pair<double, double> depth_range_mm, double deadline_ms, double max_age_ms)
      : order(channel_order(channel_order_name)) {
    rest.threads = threads;
    if (network) rest.network = Size{network->first, network->second};
    rest.limits.min_confidence = min_confidence;
    std::tie(rest.limits.min_depth_mm, rest.limits.max_depth_mm) = depth_range_mm;
    rest.deadline_ms = deadline_ms;
    rest.max_age_ms = max_age_ms;
    rest.log = {log_line<rig_logger>, nullptr, ENDO_LOG_INFO, nullptr};
    rest.frame_log = {log_line<frame_logger>, nullptr, ENDO_LOG_WARNING, nullptr};
    check_settings(rest);
    if (rest.threads == 0) rest.threads = default_thread_count();
  }
};

// The core's part of one DepthEstimator.
class PythonFramePath {
 public:
  PythonFramePath(py::object session, const PythonSettings& settings)
      : order_(settings.order),
        path_(std::make_shared<FramePath>(std::make_shared<PythonSession>(std::move(session)), settings.rest)) {}

  ~PythonFramePath() {
    // A forked child must not free the frame path: the runtime would wait for threads that exist only in the parent.
    if (!path_->process().is_this()) static_cast<void>(new std::shared_ptr<FramePath>(path_));
  }
  PythonFramePath(const PythonFramePath&) = delete;
  PythonFramePath& operator=(const PythonFramePath&) = delete;

  FrameReport predict(const py::array& left, const py::array& right, const py::tuple& maps, int64_t stamp_ns) {
    FramePair pair = pair_of(left, right, order_);
    pair.stamp_ns = stamp_ns;
    check_pair(pair);
    const MapsOut out = maps_out(maps, pair.size());
    const py::gil_scoped_release release;
    return path_->predict(pair, out);
  }

  std::unique_ptr<PythonStream> stream(int width, int height, bool temporal) {
    std::unique_ptr<Stream> opened;
    {
      const py::gil_scoped_release release;
      opened = path_->stream({width, height});
      opened->set_temporal(temporal);
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
  auto out_left = new_picture(size);
  auto out_right = new_picture(size);
  uint8_t* const to_left = out_left.mutable_data();
  uint8_t* const to_right = out_right.mutable_data();
  {
    const py::gil_scoped_release release;
    RowsOfPairs(std::make_shared<const RectifyStage>(size, &rig, std::nullopt, [] {})).write(pair, to_left, to_right);
  }
  return py::make_tuple(out_left, out_right);
}

// Measures of the causes for which `pick` is true.
py::dict measures_of(const Causes& causes, bool (Causes::*pick)(Cause) const) {
  py::dict measures;
  for (const CauseFact& fact : cause_facts) {
    if ((causes.*pick)(fact.cause)) measures[py::cast(fact.cause)] = causes.measure(fact.cause);
  }
  return measures;
}

using IdentityTexts = std::array<std::string, 9>;

IdentityTexts texts_of(const Identity& i) {
  return {i.endosdk, i.model,          i.model_version, i.model_sha256, i.calibration_sha256,
          i.runtime, i.runtime_sha256, i.provider,      i.device};
}

void bind_identity(py::module_& m) {
  py::class_<Identity>(m, "Identity", "What a result was computed with.")
      .def_readonly("endosdk", &Identity::endosdk)
      .def_readonly("model", &Identity::model)
      .def_readonly("model_version", &Identity::model_version)
      .def_readonly("model_sha256", &Identity::model_sha256)
      .def_readonly("calibration_sha256", &Identity::calibration_sha256)
      .def_readonly("runtime", &Identity::runtime)
      .def_readonly("runtime_sha256", &Identity::runtime_sha256)
      .def_readonly("provider", &Identity::provider)
      .def_readonly("device", &Identity::device)
      .def("__eq__", [](const Identity& i, const Identity& other) { return texts_of(i) == texts_of(other); }, py::is_operator())
      .def("__hash__", [](const Identity& i) { return py::hash(py::tuple(py::cast(texts_of(i)))); })
      .def("__repr__",
           [](const Identity& i) { return "Identity" + std::string(py::repr(py::tuple(py::cast(texts_of(i))))); })
      .def(py::pickle(
          &texts_of,
          [](const IdentityTexts& s) { return Identity{s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8]}; }));
}

void bind_report(py::module_& m) {
  bind_identity(m);
  py::class_<FrameReport>(m, "FrameReport", "What is said of one frame besides its maps.")
      .def_readonly("frame", &FrameReport::frame)
      .def_readonly("valid_share", &FrameReport::valid_share)
      .def_readonly("status", &FrameReport::quality)
      .def_property_readonly("causes", [](const FrameReport& r) { return measures_of(r.causes, &Causes::raised); })
      .def_property_readonly("measures", [](const FrameReport& r) { return measures_of(r.causes, &Causes::measured); })
      .def_property_readonly("pose", [](const FrameReport& r) { return pose_tuple(r.pose); })
      .def_property_readonly("steady", [](const FrameReport& r) { return pose_tuple(r.steady); })
      .def_property_readonly("drifted", [](const FrameReport& r) { return has_drifted(r.steady); })
      .def_readonly("corrected", &FrameReport::corrected)
      .def_readonly("rectify_ms", &FrameReport::rectify_ms)
      .def_readonly("session_ms", &FrameReport::session_ms)
      .def_readonly("postprocess_ms", &FrameReport::postprocess_ms)
      .def_readonly("total_ms", &FrameReport::total_ms)
      .def_readonly("late", &FrameReport::late)
      .def_readonly("stamp_ns", &FrameReport::stamp_ns)
      .def_readonly("age_ms", &FrameReport::age_ms)
      .def_property_readonly("identity", [](const FrameReport& r) { return *r.identity; });
}

void bind_stream(py::module_& m) {
  py::class_<PythonStream>(m, "Stream", "Frames in flight; one thread may submit while another receives.")
      .def_property_readonly("lanes", &PythonStream::lanes)
      .def("wait_for_room", &PythonStream::wait_for_room)
      .def("submit", &PythonStream::submit, py::arg("left").noconvert(), py::arg("right").noconvert(), py::arg("maps"),
           py::arg("stamp_ns"))
      .def("receive", &PythonStream::receive)
      .def("follow_rig", &PythonStream::follow_rig, py::call_guard<py::gil_scoped_release>())
      .def("end", &PythonStream::end)
      .def("close", &PythonStream::close);
}

}  // namespace

// Calls release the GIL before they wait for a lock of the core. The thread that holds this lock may be waiting for the GIL, to
// run the network or to free Python objects.
void bind_frame_path(py::module_& m) {
  using py::arg;
  using Path = PythonFramePath;
  using release = py::call_guard<py::gil_scoped_release>;
  bind_report(m);
  bind_stream(m);
  m.def(
      "nearest_depth_mm",
      [](const RigNumbers& numbers, int max_candidate_disparity, int inference_width) {
        const Rig rig = rig_of(numbers);
        ModelInfo model;
        model.max_candidate_disparity = max_candidate_disparity;
        const Size network = network_size_of(rig.size(), inference_width);
        return nearest_depth_mm(rig, largest_disparity(model, rig.size(), network));
      },
      arg("rig"), arg("max_candidate_disparity"), arg("inference_width"),
      "Nearest depth, mm, that a model sees on a rig at its usual size; NaN where its range is 0: not stated.");
  m.def("rectified_views", &rectified_views, arg("left").noconvert(), arg("right").noconvert(), arg("rig"));
  py::class_<PythonSettings>(m, "FramePathSettings", "What a host may choose of a frame path, checked.")
      .def(py::init<const std::string&, int, OptionalSize, double, std::pair<double, double>, double, double>(),
           arg("channel_order"), arg("threads"), arg("network_size"), arg("min_confidence"), arg("depth_range_mm"),
           arg("deadline_ms"), arg("max_age_ms"))
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
      .def("predict", &Path::predict, arg("left").noconvert(), arg("right").noconvert(), arg("maps"), arg("stamp_ns"))
      .def("stream", &Path::stream, arg("width"), arg("height"), arg("temporal"))
      .def("rectify", &Path::rectify, arg("left").noconvert(), arg("right").noconvert())
      .def("rectified", &Path::rectified)
      .def("prepare", [](Path& p, int width, int height) { p.path().prepare({width, height}); }, arg("width"),
           arg("height"), release())
      .def("cancel", [](Path& p) { p.path().cancel(); }, release())
      .def("self_test", [](Path& p) { p.path().self_test(); }, release())
      .def("cells_of_answer", [](Path& p) {
        const CellsOfAnswer cells = [&] {
          const py::gil_scoped_release unlocked;
          return p.path().cells_of_answer();
        }();
        const auto map = [](const GoldenCells& means) { return py::array_t<float>({golden_rows, golden_columns}, means.data()); };
        return std::pair(map(cells.disparity), map(cells.confidence));
      })
      .def("close", [](Path& p) { p.path().close(); }, release())
      .def("largest_disparity", [](Path& p, int width, int height) { return p.path().largest_disparity({width, height}); },
           arg("width"), arg("height"), release())
      .def("nearest_depth_mm", [](Path& p) { return p.path().nearest_depth_mm(); }, release())
      .def("diagnostics", [](Path& p) { return p.path().diagnostics().done(); }, release());
}

}  // namespace endosdk
