#include "frame_path/frame_path.hpp"

#include <cstdio>
#include <limits>

#include "frame_path/network_size.hpp"
#include "frame_path/self_test.hpp"
#include "frame_path/stream.hpp"
#include "platform/errors.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

FramePathSettings checked(FramePathSettings settings) {
  check_settings(settings);
  if (settings.threads == 0) settings.threads = default_thread_count();
  return settings;
}

bool same(Size a, Size b) { return a.width == b.width && a.height == b.height; }

size_t bytes(Size size) { return size_t{3} * static_cast<size_t>(size.width) * static_cast<size_t>(size.height); }

void check_capacity(size_t capacity, Size size) {
  require(capacity >= bytes(size), "capacity", Text("must be at least ", bytes(size), " bytes"), capacity);
}

}  // namespace

FramePath::FramePath(std::shared_ptr<Session> session, FramePathSettings settings)
    : settings_(checked(std::move(settings))), session_(std::move(session)) {}

void FramePath::set_calibration(std::optional<Rig> rig) {
  const std::lock_guard lock(calls_);
  check_open();
  auto made = rig ? std::make_shared<const Rig>(std::move(*rig)) : nullptr;
  slot_.reset();  // its maps belong to the former rig
  full_.reset();
  const std::lock_guard state(state_);
  rig_ = std::move(made);
  latest_.reset();
  picture_.reset();
}

std::shared_ptr<const Rig> FramePath::calibration() const {
  const std::lock_guard lock(state_);
  return rig_;
}

void FramePath::check_open() const {
  const std::lock_guard lock(state_);
  require(!closed_, "estimator", "must be open", "a closed one");
}

Size FramePath::network_size(Size frame) const {
  return settings_.network.value_or(network_size_of(frame, model().inference_width));
}

double FramePath::nearest_depth_mm() const {
  const std::shared_ptr<const Rig> rig = calibration();
  const int end = model().max_candidate_disparity;
  if (!rig || end == 0) return std::numeric_limits<double>::quiet_NaN();
  const RectifiedGeometry& g = rig->geometry();
  const double gain = static_cast<double>(rig->size().width) / network_size(rig->size()).width;
  const double farthest_apart = (end - range_margin) * gain + g.doffs() - RectifyStage::right_shift_of(rig.get());
  return farthest_apart > 0.0 ? g.focal_px() * g.baseline_mm() / farthest_apart : std::numeric_limits<double>::quiet_NaN();
}

const std::shared_ptr<Slot>& FramePath::prepared(Size frame, const Work& work) {
  if (slot_ && same(slot_->stage().frame(), frame)) return slot_;
  const std::shared_ptr<const Rig> rig = calibration();
  auto stage = std::make_shared<const RectifyStage>(frame, rig.get(), network_size(frame), [&] { work.check(); });
  slot_ = std::make_shared<Slot>(std::move(stage), session_);
  const std::lock_guard lock(state_);
  picture_ = slot_->stage().picture();
  return slot_;
}

void FramePath::prepare(Size frame) {
  const std::lock_guard lock(calls_);
  check_open();
  const ThreadCount threads(settings_.threads);
  const Clock::time_point asked = Clock::now();
  require(frame.width > 0 && frame.height > 0, "size", "must be at least 1x1", Text(frame.width, "x", frame.height));
  // A black pair takes the same path as a real one, and makes every layer reserve what it will need.
  const std::vector<uint8_t> black(bytes(frame));
  const ImageView view = {black.data(), frame.width, frame.height, 3, ptrdiff_t{3} * frame.width};
  compute({view, view, ChannelOrder::rgb}, {}, asked);
}

FrameReport FramePath::predict(const FramePair& pair, const MapsOut& wanted) {
  const Clock::time_point asked = Clock::now();
  const std::lock_guard lock(calls_);
  try {
    check_open();
    check_pair(pair);
    check_maps(wanted, pair.size(), calibration() != nullptr);
    const ThreadCount threads(settings_.threads);
    FrameReport report = compute(pair, wanted, asked);
    count(report, slot_);
    return report;
  } catch (...) {
    counters_.add_failure();
    throw;
  }
}

FrameReport FramePath::compute(const FramePair& pair, const MapsOut& wanted, Clock::time_point asked) {
  Work work(cancelling_);
  const Clock::time_point started = Clock::now();
  {
    const std::lock_guard lock(state_);
    latest_.reset();  // its pictures are about to be overwritten
  }
  Slot& slot = *prepared(pair.size(), work);
  FrameReport report;
  report.rectify_ms = milliseconds(started, Clock::now());
  slot.rectify(pair, report);
  slot.answer(wanted, settings_.limits, calibration().get(), work, report);
  finish(report, asked);
  return report;
}

void FramePath::finish(FrameReport& report, Clock::time_point asked) const {
  report.total_ms = milliseconds(asked, Clock::now());
  report.late = settings_.deadline_ms > 0.0 && report.total_ms > settings_.deadline_ms;
}

void FramePath::count(FrameReport& report, std::shared_ptr<Slot> slot) {
  report.frame = counters_.add(report);
  {
    const std::lock_guard lock(state_);
    latest_ = std::move(slot);
  }
  char line[96];
  const auto number = static_cast<unsigned long long>(report.frame);
  if (!report.views_belong_together) {
    std::snprintf(line, sizeof line, "frame %llu: the two views do not show the same", number);
    settings_.log(ENDO_LOG_WARNING, line);
  }
  if (!report.late) return;
  std::snprintf(line, sizeof line, "frame %llu was late: %.1f ms", number, report.total_ms);
  settings_.log(ENDO_LOG_WARNING, line);
}

std::shared_ptr<Session> FramePath::session_of_streams() {
  if (!one_thread_each_) {
    one_thread_each_ = session_->for_one_thread_each();
    if (!one_thread_each_) one_thread_each_ = session_;
  }
  return one_thread_each_;
}

std::unique_ptr<Stream> FramePath::stream(Size frame) {
  const std::lock_guard lock(calls_);
  check_open();
  const Work work(cancelling_);
  const ThreadCount threads(settings_.threads);
  const std::shared_ptr<const Rig> rig = calibration();
  auto stage = slot_ && same(slot_->stage().frame(), frame)
                   ? slot_->shared_stage()
                   : std::make_shared<const RectifyStage>(frame, rig.get(), network_size(frame), [&] { work.check(); });
  {
    const std::lock_guard state(state_);
    picture_ = stage->picture();
  }
  return std::make_unique<Stream>(shared_from_this(), session_of_streams(), std::move(stage), rig);
}

void FramePath::rectify(const FramePair& pair, uint8_t* left, uint8_t* right, size_t capacity) {
  const std::lock_guard lock(calls_);
  check_open();
  check_pair(pair);
  const Size size = pair.size();
  check_capacity(capacity, size);
  const ThreadCount threads(settings_.threads);
  if (!full_ || !same(full_->frame(), size)) {
    const Work work(cancelling_);
    full_ = std::make_shared<const RectifyStage>(size, calibration().get(), size, [&] { work.check(); });
  }
  std::vector<uint8_t> planes(2 * bytes(size));
  const PlanarView views[2] = {{planes.data(), size.width, size.height},
                               {planes.data() + bytes(size), size.width, size.height}};
  RectifyScratch scratch;
  (*full_)(pair.left, pair.right, views[0], views[1], pair.order, scratch);
  copy_interleaved(views[0], size, left);
  copy_interleaved(views[1], size, right);
}

Size FramePath::rectified_size() {
  const std::lock_guard lock(calls_);
  const std::lock_guard state(state_);
  require(latest_ != nullptr, "estimator", "must have answered a frame before its pictures can be copied", "no frame yet");
  return latest_->stage().picture();
}

void FramePath::rectified(uint8_t* left, uint8_t* right, size_t capacity) {
  const Size size = rectified_size();
  check_capacity(capacity, size);
  const std::lock_guard lock(calls_);
  const std::lock_guard state(state_);
  const bool still = latest_ != nullptr && same(latest_->stage().picture(), size);
  require(still, "estimator", "must not be used by another call meanwhile", "another frame");
  latest_->copy_pictures(left, right);
}

void FramePath::self_test() {
  const std::lock_guard lock(calls_);
  check_open();
  Work work(cancelling_);
  const ThreadCount threads(settings_.threads);
  constexpr Size small = {320, 256};
  run_self_test(*session_, slot_ ? slot_->stage().picture() : settings_.network.value_or(small), work);
}

void FramePath::close() {
  {
    const std::lock_guard state(state_);
    closed_ = true;
  }
  const std::lock_guard lock(calls_);
  slot_.reset();
  full_.reset();
  one_thread_each_.reset();
  const std::lock_guard state(state_);
  latest_.reset();
}

}  // namespace endosdk
