#include "frame_path/stream.hpp"

#include <algorithm>
#include <utility>

#include "functions/function.hpp"
#include "model/providers.hpp"
#include "platform/errors.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

// On an accelerator one frame is rectified while the network works on another.
constexpr int accelerator_lanes = 2;

// Measured frames between corrections of the rectification.
constexpr int frames_per_correction = 30;

}  // namespace

Stream::Stream(std::shared_ptr<FramePath> path, std::shared_ptr<Session> session,
               std::shared_ptr<const RectifyStage> stage, std::shared_ptr<const Rig> rig)
    : path_(std::move(path)),
      session_(std::move(session)),
      rig_(std::move(rig)),
      identity_(path_->identity()),
      lanes_(session_->facts().provider == cpu_provider ? path_->settings().threads : accelerator_lanes),
      size_(stage->frame()),
      picture_(stage->picture()),
      frames_(static_cast<size_t>(lanes_) + 1),
      stage_(std::move(stage)) {
  for (Frame& frame : frames_) frame.slot = std::make_shared<Slot>(stage_, session_);
  const Scratch::Expect calls(lanes_);
  threads_.reserve(static_cast<size_t>(lanes_));
  const std::vector<uint8_t> black(rgb_bytes(size_));
  const ImageView view = {black.data(), size_.width, size_.height, 3, ptrdiff_t{3} * size_.width};
  try {
    for (int i = 0; i < lanes_; ++i) threads_.push_back(new_thread([this, i, view] { begin(i, view), serve(); }));
    std::unique_lock lock(mutex_);
    change_.wait(lock, [&] { return begun_ == lanes_; });
    if (failure_) std::rethrow_exception(failure_);
    watch_.make_room(*frames_.front().slot);
    lock.unlock();
    path_->add_stream(this);
  } catch (...) {
    close();
    throw;
  }
}

void Stream::set_temporal(bool on) {
  const std::lock_guard lock(mutex_);
  require(submitted_ == 0, "stream", "temporal must be chosen before the first frame", Text(submitted_, " frames submitted"));
  temporal_ = on;
}

bool Stream::wait_for_room() {
  path_->process().check();
  path_->check_open();
  std::unique_lock lock(mutex_);
  change_.wait(lock, [&] { return has_room() || ended_ || closed_; });
  return !ended_ && !closed_;
}

void Stream::submit(const FramePair& pair, const MapsOut& maps, void* tag, Clock::time_point asked) {
  path_->process().check();
  path_->check_open();
  check_pair(pair);
  path_->check_stamp(pair);
  const Size size = size_;
  require(pair.size() == size, "left", Text("must have the size of the stream, ", size), pair.size());
  check_maps(maps, size, rig_ != nullptr);
  // Under one lock with the entry: a stream that ends meanwhile has taken the frame, or refuses it.
  std::unique_lock lock(mutex_);
  change_.wait(lock, [&] { return has_room() || ended_ || closed_; });
  require(!ended_ && !closed_, "stream", "must not have ended", "an ended one");
  Frame& frame = at(submitted_);
  frame.pair = pair;
  frame.maps = maps;
  frame.asked = asked;
  frame.read = frame.done = false;
  frame.answer = {{}, tag, nullptr};
  frame.answer.report.stamp_ns = pair.stamp_ns;
  frame.answer.report.identity = identity_;
  ++submitted_;
  change_.notify_all();
  change_.wait(lock, [&] { return frame.read || (closed_ && started_ < submitted_); });
  require(frame.read, "stream", "must not have ended", "an ended one");
}

bool Stream::wait_for_answer(std::chrono::microseconds longest) {
  path_->process().check();
  std::unique_lock lock(mutex_);
  return change_.wait_for(lock, longest, [&] { return has_answer(); });
}

std::optional<Stream::Answer> Stream::receive() {
  path_->process().check();
  std::unique_lock lock(mutex_);
  change_.wait(lock, [&] { return has_answer(); });
  if (closed_ || received_ == submitted_) return std::nullopt;
  Frame& frame = at(received_);
  available_ = std::max(available_, frame.finished);
  const Clock::duration waited = available_ - frame.asked;
  // Before there is room for a further frame, whose pictures come to where those of the last but one are.
  path_->keep_latest(frame.answer.error ? nullptr : frame.slot);
  ++received_;
  change_.notify_all();
  Answer answer = std::move(frame.answer);
  lock.unlock();
  try {
    if (answer.error) {
      skip_frame();
      std::rethrow_exception(answer.error);
    }
    const Clock::time_point watched = Clock::now();
    watch_rig(answer.report, *frame.slot);
    path_->finish(answer.report, waited + (Clock::now() - watched));
    path_->hand_out(answer.report);
  } catch (...) {
    answer.error = std::current_exception();  // the frame is received all the same, and its maps are free again
    path_->counters_.add_failure();
  }
  return answer;
}

void Stream::follow_rig() {
  require(rig_ != nullptr, ENDO_CALIBRATION_REQUIRED, "follow_rig", calibration_rule, "no calibration");
  path_->process().check();
  path_->check_open();
  std::unique_lock lock(mutex_);
  require(!closed_, "stream", "must not have ended", "an ended one");
  if (!follower_.joinable()) follower_ = new_thread([this] { follow(); });
  change_.wait(lock, [&] { return following_ || closed_; });
}

void Stream::skip_frame() {
  const std::lock_guard lock(mutex_);
  watch_.skip();
}

// Takes one frame's pose error, in the order of the frames, and asks for the correction that later frames shall have.
void Stream::watch_rig(FrameReport& report, Slot& slot) {
  const LoopThreads alone(1);  // the cores work on other frames
  const std::lock_guard lock(mutex_);
  watch_.add(report, slot);
  if (!following_ || correction_ || watch_.frames() < corrected_at_ + frames_per_correction) return;
  correction_ = next_correction(stage_->corrected(), report.steady);
  if (!correction_) return;
  corrected_at_ = watch_.frames();
  change_.notify_all();
}

// To compute the maps of a new rectification takes longer than a frame, and memory: no frame waits for it.
void Stream::follow() {
  start_thread("endosdk-follow", path_->settings().thread_hook);
  set_thread_count(1);
  std::unique_lock lock(mutex_);
  following_ = true;
  change_.notify_all();
  for (;;) {
    change_.wait(lock, [&] { return closed_ || correction_; });
    if (closed_) return;
    const PoseVector correction = *correction_;
    lock.unlock();
    std::shared_ptr<const RectifyStage> stage = corrected_stage(correction);
    lock.lock();
    if (stage) stage_ = std::move(stage);
    correction_.reset();
  }
}

// None where it cannot be made, as for want of memory: the rectification stays as it is, and the frames say that the rig has
// moved. None of a closed stream either. No exception may leave the thread, not even one of the host's log.
std::shared_ptr<const RectifyStage> Stream::corrected_stage(const PoseVector& correction) {
  try {
    const auto needed = [this] {  // nobody waits for the maps of a stream that is closed
      const std::lock_guard lock(mutex_);
      require(!closed_, "stream", "must not have ended", "an ended one");
    };
    auto stage = std::make_shared<const RectifyStage>(size_, rig_.get(), picture_, needed, correction);
    path_->tell_correction(correction);
    return stage;
  } catch (...) {
    return nullptr;
  }
}

// A black pair takes the same path as a real one, and makes every layer reserve what it will need: of each slot, and of as many
// frames at a time as there are threads.
void Stream::begin(int lane, const ImageView& black) {
  start_thread("endosdk-stream", path_->settings().thread_hook);
  set_thread_count(1);
  std::exception_ptr failure;
  try {
    for (size_t i = static_cast<size_t>(lane); i < frames_.size(); i += static_cast<size_t>(lanes_)) {
      Work work(path_->cancelling_);
      FrameReport report;
      Slot& slot = *frames_[i].slot;
      slot.rectify({black, black, ChannelOrder::rgb}, report);
      slot.infer(work, report);
      slot.answer({}, path_->settings().limits, rig_.get(), work, report);
    }
  } catch (...) {
    failure = std::current_exception();
  }
  const std::lock_guard lock(mutex_);
  if (failure) failure_ = failure;
  ++begun_;
  change_.notify_all();
}

void Stream::serve() {
  std::unique_lock lock(mutex_);
  for (;;) {
    change_.wait(lock, [&] { return closed_ || started_ < submitted_; });
    if (closed_) return;
    const uint64_t number = started_++;
    Frame& frame = at(number);
    lock.unlock();
    work(frame, number);
    lock.lock();
    frame.read = frame.done = true;
    change_.notify_all();
  }
}

void Stream::work(Frame& frame, uint64_t number) {
  std::optional<Turn> turn;
  if (temporal_) turn.emplace(turns_, number);
  try {
    Work work(path_->cancelling_);
    {
      const std::lock_guard lock(mutex_);
      frame.slot->use(stage_);
    }
    frame.slot->rectify(frame.pair, frame.answer.report);
    {
      const std::lock_guard lock(mutex_);
      frame.read = true;
    }
    change_.notify_all();
    frame.slot->infer(work, frame.answer.report);
    if (turn) {
      turn->wait();
      frame.slot->smooth_over_time(filter_, frame.answer.report);
      turn->pass();
    }
    frame.slot->answer(frame.maps, path_->settings().limits, rig_.get(), work, frame.answer.report);
  } catch (...) {
    frame.answer.error = std::current_exception();
  }
  frame.finished = Clock::now();
}

void Stream::end() {
  if (!path_->process().is_this()) return;
  const std::lock_guard lock(mutex_);
  ended_ = true;
  change_.notify_all();
}

void Stream::close() {
  if (!path_->process().is_this()) return;
  path_->remove_stream(this);
  std::thread follower;
  {
    const std::lock_guard lock(mutex_);
    ended_ = closed_ = true;
    follower = std::move(follower_);
    change_.notify_all();
  }
  for (std::thread& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
  if (follower.joinable()) follower.join();
}

}  // namespace endosdk
