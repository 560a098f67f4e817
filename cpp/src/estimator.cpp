#include "estimator.hpp"

#include <chrono>
#include <cstdio>
#include <limits>
#include <vector>

#include "build_info.hpp"
#include "json.hpp"
#include "kernels/kernels.hpp"
#include "network_size.hpp"
#include "self_test.hpp"
#include "status.hpp"
#include "threads.hpp"

namespace endosdk {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double, std::milli>(to - from).count();
}

EstimatorSettings with_threads(EstimatorSettings settings) {
  if (settings.session.threads == 0) settings.session.threads = default_thread_count();
  return settings;
}

void copy_interleaved(const PlanarView& from, Size size, uint8_t* to) {
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (int plane = 0; plane < 3; ++plane) *to++ = from.row(plane, y)[x];
    }
  }
}

}  // namespace

// The time in which a call can be cancelled.
class Estimator::Running {
 public:
  explicit Running(Estimator& estimator) : estimator_(estimator) {
    const std::lock_guard lock(estimator_.cancelling_);
    estimator_.session_.resume();
    estimator_.cancelled_ = false;
    estimator_.running_ = true;
  }

  ~Running() {
    const std::lock_guard lock(estimator_.cancelling_);
    estimator_.running_ = false;
  }

  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  void check() const {
    const std::lock_guard lock(estimator_.cancelling_);
    if (estimator_.cancelled_) throw Error(ENDO_CANCELLED, "predict: was cancelled by endo_cancel");
  }

 private:
  Estimator& estimator_;
};

Estimator::Estimator(const ModelFile& model, EstimatorSettings settings)
    : settings_(with_threads(std::move(settings))),
      session_(Runtime::open(settings_.runtime_library, settings_.log), model, settings_.session, settings_.log) {}

void Estimator::set_calibration(std::optional<Rig> rig) {
  const std::lock_guard lock(calls_);
  rig_ = std::move(rig);
  frames_.reset();  // its maps belong to the former rig
  has_picture_ = false;
}

std::optional<Rig> Estimator::calibration() const {
  const std::lock_guard lock(calls_);
  return rig_;
}

void Estimator::make_frames(Size frame, const Running& running) {
  if (frames_ && frames_->stage.frame().width == frame.width && frames_->stage.frame().height == frame.height) return;
  const Size usual = usual_network_size(frame, session_.info().usual_width);
  RectifyStage stage(frame, rig_ ? &*rig_ : nullptr, settings_.network.value_or(usual), [&] { running.check(); });
  Session::Buffers buffers(session_, stage.picture());
  const size_t pixels = static_cast<size_t>(frame.width) * static_cast<size_t>(frame.height);
  frames_ = std::make_unique<Frames>(Frames{std::move(stage), std::move(buffers), SpareMaps(pixels), {}, {}});
  has_picture_ = false;
}

void Estimator::prepare(Size frame) {
  const std::lock_guard lock(calls_);
  const ThreadCount threads(settings_.session.threads);
  const Running running(*this);
  make_frames(frame, running);
  has_picture_ = false;
  // A black pair takes the same path as a real one, and makes every layer reserve what it will need.
  const std::vector<uint8_t> black(static_cast<size_t>(frame.width) * static_cast<size_t>(frame.height) * 3);
  const ImageView view = {black.data(), frame.width, frame.height, 3, ptrdiff_t{3} * frame.width};
  running.check();
  compute({view, view, ChannelOrder::rgb}, frames_->spare.complete({}), running);
}

FrameReport Estimator::predict(const FramePair& pair, const MapsOut& wanted) {
  const std::lock_guard lock(calls_);
  try {
    require(rig_ || !wanted.wants_depth(), ENDO_CALIBRATION_REQUIRED, "result",
            "depth and sigma need a calibration: call endo_set_calibration", "no calibration");
    check_source(pair.left, pair.order, "left");
    check_source(pair.right, pair.order, "right");
    const ThreadCount threads(settings_.session.threads);
    const Running running(*this);
    const Clock::time_point started = Clock::now();
    make_frames({pair.left.width, pair.left.height}, running);
    has_picture_ = false;
    const double prepare_ms = milliseconds(started, Clock::now());
    FrameReport report = compute(pair, frames_->spare.complete(wanted), running);
    report.rectify_ms += prepare_ms;
    has_picture_ = true;
    count(report);
    return report;
  } catch (...) {
    ++failed_;
    throw;
  }
}

FrameReport Estimator::compute(const FramePair& pair, const MapsOut& maps, const Running& running) {
  Frames& f = *frames_;
  const Clock::time_point started = Clock::now();
  f.stage(pair.left, pair.right, f.buffers.left(), f.buffers.right(), pair.order, f.rectify_scratch);
  running.check();
  const Clock::time_point rectified = Clock::now();
  try {
    session_.run(f.buffers);
  } catch (const Error&) {
    running.check();  // a run that was told to stop fails
    throw;
  }
  running.check();
  const Clock::time_point inferred = Clock::now();
  const int answered = postprocess_frame(maps, same_pixels(pair.left, pair.right));
  running.check();
  FrameReport report;
  report.rectify_ms = milliseconds(started, rectified);
  report.session_ms = milliseconds(rectified, inferred);
  report.postprocess_ms = milliseconds(inferred, Clock::now());
  report.valid_share = answered / static_cast<double>(f.pixels());
  return report;
}

int Estimator::postprocess_frame(const MapsOut& maps, bool same_frames) {
  Frames& f = *frames_;
  const Size frame = f.stage.frame();
  const Size picture = f.stage.picture();
  const int stride = session_.info().output_stride;
  PostprocessInput in;
  in.disparity = f.buffers.disparity();
  in.confidence = f.buffers.confidence();
  // Relative to the picture without its padding, which the grids include.
  in.view_scale = {static_cast<double>(picture.height) / frame.height, static_cast<double>(picture.width) / frame.width};
  in.scale = {in.view_scale.y / stride, in.view_scale.x / stride};
  in.gain = static_cast<float>(static_cast<double>(frame.width) / picture.width);
  in.min_confidence = static_cast<float>(settings_.min_confidence);
  in.last_plane = session_.info().last_plane;
  in.left = f.buffers.left();
  in.right = f.buffers.right();
  in.same_frames = same_frames;
  in.right_shift = f.stage.right_shift();
  in.valid_left = f.stage.valid_left();
  in.valid_right = f.stage.valid_right();
  if (rig_) {
    const RectifiedGeometry& g = rig_->geometry();
    in.geometry = {g.focal_px(), g.baseline_mm(), g.doffs(), settings_.min_depth_mm, settings_.max_depth_mm};
  }
  PostprocessOutput out;
  out.disparity = {maps.disparity, frame.width, frame.height};
  out.confidence = {maps.confidence, frame.width, frame.height};
  out.reasons = maps.reasons;
  out.depth = maps.depth;
  out.sigma = maps.sigma;
  const int answered = postprocess(in, out, f.scratch);
  write_u16(maps, f.pixels(), settings_.depth_unit_mm);
  return answered;
}

void Estimator::count(FrameReport& report) {
  const double total = report.rectify_ms + report.session_ms + report.postprocess_ms;
  latency_.add(total);
  report.frame = latency_.count();
  report.late = settings_.deadline_ms > 0.0 && total > settings_.deadline_ms;
  char line[96];
  if (!frames_->scratch.agreement.views_belong_together()) {
    ++mismatched_;
    std::snprintf(line, sizeof line, "frame %llu: the two views do not show the same",
                  static_cast<unsigned long long>(report.frame));
    settings_.log(ENDO_LOG_WARNING, line);
  }
  if (!report.late) return;
  ++late_;
  std::snprintf(line, sizeof line, "frame %llu was late: %.1f ms", static_cast<unsigned long long>(report.frame), total);
  settings_.log(ENDO_LOG_WARNING, line);
}

void Estimator::rectified(uint8_t* left, uint8_t* right, size_t capacity) const {
  const std::lock_guard lock(calls_);
  require(has_picture_, ENDO_INVALID_ARGUMENT, "estimator", "endo_predict must have succeeded before endo_get_rectified",
          "no pair yet");
  const Size size = frames_->stage.picture();
  const size_t bytes = size_t{3} * static_cast<size_t>(size.width) * static_cast<size_t>(size.height);
  require(capacity >= bytes, ENDO_INVALID_ARGUMENT, "capacity", Text("must be at least ", bytes, " bytes"),
          capacity);
  if (left != nullptr) copy_interleaved(frames_->buffers.left(), size, left);
  if (right != nullptr) copy_interleaved(frames_->buffers.right(), size, right);
}

void Estimator::cancel() {
  const std::lock_guard lock(cancelling_);
  if (!running_) return;
  cancelled_ = true;
  session_.terminate();
}

void Estimator::self_test() {
  const std::lock_guard lock(calls_);
  const Running running(*this);
  const Size usual = {320, 256};
  try {
    run_self_test(session_, frames_ ? frames_->stage.picture() : settings_.network.value_or(usual));
  } catch (const Error&) {
    running.check();
    throw;
  }
}

double Estimator::nearest_depth_mm() const {
  const int last_plane = session_.info().last_plane;
  if (!rig_ || !frames_ || last_plane == 0) return std::numeric_limits<double>::quiet_NaN();
  const RectifiedGeometry& g = rig_->geometry();
  const double gain = static_cast<double>(frames_->stage.frame().width) / frames_->stage.picture().width;
  const double farthest_apart = (last_plane - range_margin) * gain + g.doffs() - frames_->stage.right_shift();
  return farthest_apart > 0.0 ? g.focal_px() * g.baseline_mm() / farthest_apart : std::numeric_limits<double>::quiet_NaN();
}

std::string Estimator::diagnostics() const {
  const std::lock_guard lock(calls_);
  const ModelInfo& info = session_.info();
  const std::string model =
      JsonObject().text("name", info.name).text("version", info.version).text("sha256", session_.model_sha256())
          .text("license", info.license).text("intended_use", info.intended_use)
          .count("max_disparity", static_cast<uint64_t>(info.max_disparity))
          .raw("max_candidate_disparity", info.last_plane > 0 ? std::to_string(info.last_plane) : "null").done();
  const std::string latency = JsonObject()
                                  .number("p50", latency_.quantile_ms(0.5)).number("p95", latency_.quantile_ms(0.95))
                                  .number("p99", latency_.quantile_ms(0.99)).number("max", latency_.longest_ms()).done();
  JsonObject report;
  report.text("endosdk", version_text()).raw("build", build_info());
  report.text("onnxruntime", session_.runtime().version()).text("onnxruntime_library", session_.runtime().path());
  report.text("onnxruntime_telemetry", session_.runtime().telemetry_on() ? "on: loaded by the host first" : "off");
  report.text("provider", session_.provider()).count("threads", static_cast<uint64_t>(settings_.session.threads));
  report.text("kernels", kernels().name).raw("integer_units", has_integer_units() ? "true" : "false");
  report.raw("model", model);
  report.raw("calibration_sha256", rig_ ? json_string(rig_->sha256()) : "null");
  if (frames_) {
    const Size picture = frames_->stage.picture();
    report.count("network_width", static_cast<uint64_t>(picture.width));
    report.count("network_height", static_cast<uint64_t>(picture.height));
  }
  report.number("nearest_depth_mm", nearest_depth_mm());
  report.count("frames", latency_.count()).count("failed", failed_).count("late", late_).count("mismatched", mismatched_);
  report.raw("latency_ms", latency);
  return report.done();
}

}  // namespace endosdk
