#include "frame_path/stream.hpp"

#include "model/providers.hpp"
#include "platform/errors.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

// On an accelerator one frame is rectified while the network works on another.
constexpr int accelerator_lanes = 2;

}  // namespace

Stream::Stream(std::shared_ptr<FramePath> path, std::shared_ptr<Session> session,
               std::shared_ptr<const RectifyStage> stage, std::shared_ptr<const Rig> rig)
    : path_(std::move(path)),
      session_(std::move(session)),
      stage_(std::move(stage)),
      rig_(std::move(rig)),
      lanes_(session_->facts().provider == cpu_provider ? path_->settings().threads : accelerator_lanes),
      frames_(static_cast<size_t>(lanes_) + 1) {
  for (Frame& frame : frames_) frame.slot = std::make_shared<Slot>(stage_, session_);
  threads_.reserve(static_cast<size_t>(lanes_));
  try {
    for (int i = 0; i < lanes_; ++i) threads_.emplace_back([this] { serve(); });
  } catch (...) {
    close();
    throw;
  }
}

bool Stream::wait_for_room() {
  std::unique_lock lock(mutex_);
  change_.wait(lock, [&] { return has_room() || ended_ || closed_; });
  return !ended_ && !closed_;
}

void Stream::submit(const FramePair& pair, const MapsOut& maps, void* tag) {
  const Clock::time_point asked = Clock::now();
  path_->check_open();
  check_pair(pair);
  const Size size = stage_->frame();
  require(pair.left.width == size.width && pair.left.height == size.height, "left",
          Text("must have the size of the stream's first frame, ", size.width, "x", size.height),
          Text(pair.left.width, "x", pair.left.height));
  check_maps(maps, size, rig_ != nullptr);
  const bool room = wait_for_room();
  require(room, "stream", "must not have ended", "an ended one");
  std::unique_lock lock(mutex_);
  Frame& frame = at(submitted_);
  frame.pair = pair;
  frame.maps = maps;
  frame.asked = asked;
  frame.read = frame.done = false;
  frame.answer = {{}, tag, nullptr};
  ++submitted_;
  change_.notify_all();
  change_.wait(lock, [&] { return frame.read || (closed_ && started_ < submitted_); });
  require(frame.read, "stream", "must not have ended", "an ended one");
}

bool Stream::wait_for_answer(std::chrono::milliseconds longest) {
  std::unique_lock lock(mutex_);
  return change_.wait_for(lock, longest, [&] { return has_answer(); });
}

std::optional<Stream::Answer> Stream::receive() {
  std::unique_lock lock(mutex_);
  change_.wait(lock, [&] { return has_answer(); });
  if (closed_ || received_ == submitted_) return std::nullopt;
  Frame& frame = at(received_++);
  change_.notify_all();
  Answer answer = std::move(frame.answer);
  lock.unlock();
  if (answer.error) {
    path_->counters_.add_failure();
  } else {
    path_->count(answer.report, frame.slot);
  }
  return answer;
}

void Stream::serve() {
  set_thread_count(1);
  std::unique_lock lock(mutex_);
  for (;;) {
    change_.wait(lock, [&] { return closed_ || started_ < submitted_; });
    if (closed_) return;
    Frame& frame = at(started_++);
    lock.unlock();
    work(frame);
    lock.lock();
    frame.read = frame.done = true;
    change_.notify_all();
  }
}

void Stream::work(Frame& frame) {
  try {
    Work work(path_->cancelling_);
    frame.slot->rectify(frame.pair, frame.answer.report);
    {
      const std::lock_guard lock(mutex_);
      frame.read = true;
    }
    change_.notify_all();
    frame.slot->answer(frame.maps, path_->settings().limits, rig_.get(), work, frame.answer.report);
    path_->finish(frame.answer.report, frame.asked);
  } catch (...) {
    frame.answer.error = std::current_exception();
  }
}

void Stream::end() {
  const std::lock_guard lock(mutex_);
  ended_ = true;
  change_.notify_all();
}

void Stream::close() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = closed_ = true;
    change_.notify_all();
  }
  for (std::thread& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
}

}  // namespace endosdk
