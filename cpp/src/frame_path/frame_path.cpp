#include "frame_path/frame_path.hpp"

#include <cstdio>
#include <limits>

#include "frame_path/network_size.hpp"
#include "frame_path/stream.hpp"
#include "frame_path/working_distance.hpp"
#include "platform/errors.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

FramePathSettings checked(FramePathSettings settings) {
  check_settings(settings);
  if (settings.threads == 0) settings.threads = default_thread_count();
  return settings;
}

// Both outputs hold the view, and neither lies in the other; null is none.
void check_outputs(const uint8_t* left, const uint8_t* right, size_t capacity, Size size) {
  require(capacity >= rgb_bytes(size), "capacity", Text("must be at least ", rgb_bytes(size), " bytes"), capacity);
  const auto memory = [&](const char* name, const uint8_t* view) {
    const auto begin = reinterpret_cast<uintptr_t>(view);
    return Memory{name, begin, view != nullptr ? begin + rgb_bytes(size) : 0};
  };
  require_apart(memory("the right output", right), memory("the left output", left));
}

}  // namespace

FramePath::FramePath(std::shared_ptr<Session> session, FramePathSettings settings)
    : settings_(checked(std::move(settings))), model_(session->model()), sessions_(std::move(session)) {
  identity_ = std::make_shared<const Identity>(identity_of(model_, sessions_.any().facts(), nullptr));
  sessions_.of(usual_size());
}

void FramePath::set_calibration(std::optional<Rig> rig) {
  auto made = rig ? std::make_shared<const Rig>(std::move(*rig)) : nullptr;
  const std::optional<RangeNote> note = range_note(nearest_depth_mm(made.get()), settings_.limits);
  keep_calibration(std::move(made));
  if (note) settings_.log(note->level, note->line.c_str());
}

void FramePath::keep_calibration(std::shared_ptr<const Rig> rig) {
  process_.check();
  const std::lock_guard lock(calls_);
  check_open();
  auto identity = std::make_shared<const Identity>(identity_of(model_, sessions_.any().facts(), rig.get()));
  // From here on nothing fails.
  slot_.reset();  // its maps belong to the former rig
  watch_ = {};
  full_.reset();
  const std::lock_guard state(state_);
  rig_ = std::move(rig);
  identity_ = std::move(identity);
  latest_.reset();
  picture_.reset();
}

std::shared_ptr<const Rig> FramePath::calibration() const {
  const std::lock_guard lock(state_);
  return rig_;
}

std::shared_ptr<const Identity> FramePath::identity() const {
  const std::lock_guard lock(state_);
  return identity_;
}

void FramePath::check_open() const {
  const std::lock_guard lock(state_);
  require(!closed_, "estimator", "must be open", "a closed one");
}

void FramePath::check_stamp(const FramePair& pair) const {
  require(settings_.max_age_ms == 0.0 || pair.stamp_ns != 0, "stamp_ns", "must be given where max_age_ms is", "none");
}

Size FramePath::network_size(Size frame) const {
  const Size network = settings_.network.value_or(network_size_of(frame, model().inference_width));
  require(network.height <= longest_side, "size", Text("must be wider: at the network's width it is higher than ", longest_side, " px"),
          frame);
  return network;
}

double FramePath::largest_disparity(Size frame) const {
  // Where the network sees the right view moved, it finds so much less.
  return network_reach(frame) - RectifyStage::right_shift_of(calibration().get());
}

double FramePath::network_reach(Size frame) const {
  check_frame_size(frame, "size");
  return endosdk::largest_disparity(model(), frame, network_size(frame));
}

Size FramePath::usual_size() const {
  // The self test needs a session for this size anyway.
  return settings_.network.value_or(golden_picture);
}

double FramePath::nearest_depth_mm() const { return nearest_depth_mm(calibration().get()); }

double FramePath::nearest_depth_mm(const Rig* rig) const {
  if (rig == nullptr) return std::numeric_limits<double>::quiet_NaN();
  return endosdk::nearest_depth_mm(*rig, network_reach(rig->size()));
}

const std::shared_ptr<Slot>& FramePath::prepared(Size frame, const Work& work) {
  if (slot_ && slot_->stage().frame() == frame) return slot_;
  const std::shared_ptr<const Rig> rig = calibration();
  auto stage = std::make_shared<const RectifyStage>(frame, rig.get(), network_size(frame), [&] { work.check(); });
  const Size picture = stage->picture();
  use(std::make_shared<Slot>(std::move(stage), sessions_.of(picture)));
  return slot_;
}

void FramePath::use(std::shared_ptr<Slot> slot) {
  slot_ = std::move(slot);
  const std::lock_guard lock(state_);
  picture_ = slot_->stage().picture();
}

void FramePath::prepare(Size frame) {
  process_.check();
  Work work(cancelling_);
  const std::lock_guard lock(calls_);
  check_open();
  work.check();
  const LoopThreads threads(settings_.threads, settings_.thread_hook);
  check_frame_size(frame, "size");
  network_size(frame);  // refuses one that is too narrow, before memory is taken for it
  // A black pair takes the same path as a real one, and makes every layer reserve what it will need.
  const std::vector<uint8_t> black(rgb_bytes(frame));
  const ImageView view = {black.data(), frame.width, frame.height, 3, ptrdiff_t{3} * frame.width};
  compute({view, view, ChannelOrder::rgb}, {}, work);
  watch_.make_room(*slot_);
  const std::lock_guard state(state_);
  if (latest_ != slot_) latest_.reset();  // the memory of the size before
}

FrameReport FramePath::predict(const FramePair& pair, const MapsOut& wanted) {
  process_.check();
  const Clock::time_point asked = Clock::now();
  Work work(cancelling_);  // a cancel reaches calls that wait, too
  const std::lock_guard lock(calls_);
  try {
    check_open();
    work.check();
    check_pair(pair);
    check_stamp(pair);
    check_maps(wanted, pair.size(), calibration() != nullptr);
    const LoopThreads threads(settings_.threads, settings_.thread_hook);
    FrameReport report = compute(pair, wanted, work);
    watch_.add(report, *slot_);
    finish(report, Clock::now() - asked);
    keep_latest(slot_);
    hand_out(report);
    return report;
  } catch (...) {
    watch_.skip();
    counters_.add_failure();
    throw;
  }
}

FrameReport FramePath::compute(const FramePair& pair, const MapsOut& wanted, Work& work) {
  const Clock::time_point started = Clock::now();
  const std::shared_ptr<Slot> former = slot_;
  try {
    const std::shared_ptr<Slot> slot = prepared(pair.size(), work);
    FrameReport report;
    report.rectify_ms = milliseconds(started, Clock::now());
    compute_in(*slot, pair, wanted, work, report);
    return report;
  } catch (...) {
    if (former) use(former);  // a frame of another size that failed must not cost the next one its maps
    throw;
  }
}

void FramePath::compute_in(Slot& slot, const FramePair& pair, const MapsOut& wanted, Work& work, FrameReport& report) {
  work.check();
  {
    const std::lock_guard lock(state_);
    if (latest_.get() == &slot) latest_.reset();  // its pictures are about to be overwritten
  }
  slot.rectify(pair, report);
  slot.infer(work, report);
  slot.answer(wanted, settings_.limits, calibration().get(), work, report);
  report.stamp_ns = pair.stamp_ns;
  report.identity = identity();
}

void FramePath::finish(FrameReport& report, Clock::duration taken) const {
  report.total_ms = milliseconds(taken);
  if (settings_.deadline_ms > 0.0) report.causes.set(Cause::late, report.total_ms / settings_.deadline_ms);
  report.late = report.causes.raised(Cause::late);
}

void FramePath::judge_age(FrameReport& report) const {
  if (report.stamp_ns == 0) return;
  report.age_ms = static_cast<double>(now_ns() - report.stamp_ns) / 1e6;
  if (settings_.max_age_ms > 0.0) report.causes.set(Cause::stale, report.age_ms / settings_.max_age_ms);
}

void FramePath::keep_latest(std::shared_ptr<Slot> slot) {
  const std::lock_guard lock(state_);
  latest_ = std::move(slot);
}

void FramePath::hand_out(FrameReport& report) {
  judge_age(report);
  report.quality = report.causes.status();
  report.frame = counters_.add(report);
  log_faults(report);
}

void FramePath::log_faults(const FrameReport& report) const {
  char line[160];
  const auto number = static_cast<unsigned long long>(report.frame);
  for (const CauseFact& fact : cause_facts) {
    if (report.causes.level(fact.cause) != Quality::invalid) continue;
    std::snprintf(line, sizeof line, "frame %llu: %s (%s %.3g)", number, fact.meaning, fact.name, report.causes.measure(fact.cause));
    settings_.frame_log(ENDO_LOG_WARNING, line);
  }
  if (report.causes.raised(Cause::stale)) {
    std::snprintf(line, sizeof line, "frame %llu is stale: it was taken %.1f ms ago", number, report.age_ms);
    settings_.frame_log(ENDO_LOG_WARNING, line);
  }
  if (!report.late) return;
  std::snprintf(line, sizeof line, "frame %llu was late: %.1f ms", number, report.total_ms);
  settings_.frame_log(ENDO_LOG_WARNING, line);
}

void FramePath::tell_correction(const PoseVector& corrected) const {
  char line[160];
  std::snprintf(line, sizeof line, "the rig has moved; the rectification now turns the right view by %.3f, %.3f, %.3f degrees (x, y, z)",
                degrees_per_radian * corrected[0], degrees_per_radian * corrected[1], degrees_per_radian * corrected[2]);
  settings_.log(ENDO_LOG_WARNING, line);
}

void FramePath::add_stream(Stream* stream) {
  const std::lock_guard lock(streams_mutex_);
  streams_.insert(stream);
}

void FramePath::remove_stream(Stream* stream) {
  const std::lock_guard lock(streams_mutex_);
  streams_.erase(stream);
}

std::unique_ptr<Stream> FramePath::stream(Size frame) {
  process_.check();
  const Work work(cancelling_);
  const std::lock_guard lock(calls_);
  check_open();
  work.check();
  check_frame_size(frame, "size");
  const LoopThreads threads(settings_.threads, settings_.thread_hook);
  const std::shared_ptr<const Rig> rig = calibration();
  auto stage = slot_ && slot_->stage().frame() == frame
                   ? slot_->shared_stage()
                   : std::make_shared<const RectifyStage>(frame, rig.get(), network_size(frame), [&] { work.check(); });
  const Size picture = stage->picture();
  auto session = sessions_.for_one_thread_each(picture);
  auto stream = std::make_unique<Stream>(shared_from_this(), std::move(session), std::move(stage), rig);
  const std::lock_guard state(state_);
  picture_ = picture;
  return stream;
}

void FramePath::rectify(const FramePair& pair, uint8_t* left, uint8_t* right, size_t capacity) {
  process_.check();
  const Work work(cancelling_);
  const std::lock_guard lock(calls_);
  check_open();
  work.check();
  check_pair(pair);
  const Size size = pair.size();
  check_outputs(left, right, capacity, size);
  const LoopThreads threads(settings_.threads, settings_.thread_hook);
  if (!full_ || full_->stage().frame() != size) {
    full_.emplace(std::make_shared<const RectifyStage>(size, calibration().get(), std::nullopt, [&] { work.check(); }));
  }
  full_->write(pair, left, right);
}

Size FramePath::rectified_size() {
  process_.check();
  const std::lock_guard lock(calls_);
  const std::lock_guard state(state_);
  require(latest_ != nullptr, "estimator", "must have answered a frame, and no other may have failed half-way since",
          "no frame yet, or one that failed");
  return latest_->stage().picture();
}

void FramePath::rectified(uint8_t* left, uint8_t* right, size_t capacity) {
  const Size size = rectified_size();
  check_outputs(left, right, capacity, size);
  const std::lock_guard lock(calls_);
  const std::lock_guard state(state_);
  const bool still = latest_ != nullptr && latest_->stage().picture() == size;
  require(still, "estimator", "must not be used by another call meanwhile", "another frame");
  latest_->copy_pictures(left, right);
}

void FramePath::self_test() {
  process_.check();
  Work work(cancelling_);
  const std::lock_guard lock(calls_);
  check_open();
  work.check();
  const LoopThreads threads(settings_.threads, settings_.thread_hook);
  const Size picture = slot_ ? slot_->stage().picture() : usual_size();
  check_answer_to_plane(sessions_.of(picture), picture, work);
  const GoldenAnswer* const golden = golden_answer(model_.sha256);
  if (golden != nullptr) {
    check_golden_answer(sessions_.of(golden_picture), *golden, work);
  } else if (picture != golden_picture) {
    check_answer_to_plane(sessions_.of(golden_picture), golden_picture, work);
  }
}

CellsOfAnswer FramePath::cells_of_answer() {
  process_.check();
  Work work(cancelling_);
  const std::lock_guard lock(calls_);
  check_open();
  const LoopThreads threads(settings_.threads, settings_.thread_hook);
  return endosdk::cells_of_answer(sessions_.of(golden_picture), work);
}

void FramePath::close() {
  if (!process_.is_this()) return;  // what is its parent's, a forked child leaves alone
  {
    const std::lock_guard state(state_);
    closed_ = true;
  }
  // Waits for the call that is running, which may be one that opens a stream.
  const std::lock_guard lock(calls_);
  {
    const std::lock_guard streams(streams_mutex_);
    for (Stream* const stream : streams_) stream->end();
  }
  slot_.reset();
  full_.reset();
  sessions_.drop();
  const std::lock_guard state(state_);
  latest_.reset();
}

}  // namespace endosdk
