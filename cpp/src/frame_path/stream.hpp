// Several frames in flight, each on a thread of its own from end to end, so that no core waits for another; their answers
// in the order in which they were submitted.
#pragma once

#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "frame_path/frame_path.hpp"
#include "frame_path/turns.hpp"
#include "maps/temporal_filter.hpp"

namespace endosdk {

// One thread may submit while another receives.
class Stream {
 public:
  // Made by FramePath::stream. Returns when each thread has computed a black pair, so that no later frame is a first one.
  Stream(std::shared_ptr<FramePath> path, std::shared_ptr<Session> session, std::shared_ptr<const RectifyStage> stage,
         std::shared_ptr<const Rig> rig);
  ~Stream() { close(); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  // Frames that may be submitted before one must be received.
  int lanes() const { return lanes_; }
  Size frame_size() const { return size_; }
  const OwnProcess& process() const { return path_->process(); }

  // From now on the rectification slowly makes up for turns of the rig that the frames show for certain.
  void follow_rig();

  // Whether each frame's disparity is drawn towards that of the frame before. To be chosen before the first frame.
  void set_temporal(bool on);

  // Waits until one more frame may be submitted; false when the stream is over.
  bool wait_for_room();

  // Hands a frame over and returns once it was read; its maps must live until it is received, with `tag`. Waits for room.
  // `asked` is when the caller called: what he waited since then counts towards the deadline.
  void submit(const FramePair& pair, const MapsOut& maps, void* tag, Clock::time_point asked);

  struct Answer {
    FrameReport report;
    void* tag = nullptr;
    std::exception_ptr error;  // of this frame; the stream goes on
  };

  // Waits for the oldest frame that was not received; none when the stream is over and all were.
  std::optional<Answer> receive();

  // The same with a limit of time: whether `receive` would return at once.
  bool wait_for_answer(std::chrono::microseconds longest);

  // No frame follows.
  void end();

  // Ends the stream, waits for what is being computed, and drops it.
  void close();

 private:
  // A frame in flight, and the memory that it and its successors use.
  struct Frame {
    std::shared_ptr<Slot> slot;
    FramePair pair;
    MapsOut maps;
    Clock::time_point asked;
    Clock::time_point finished;
    bool read = false;
    bool done = false;
    Answer answer;
  };

  Frame& at(uint64_t number) { return frames_[static_cast<size_t>(number % frames_.size())]; }
  bool has_answer() { return closed_ || (received_ < submitted_ ? at(received_).done : ended_); }
  bool has_room() const { return submitted_ < received_ + static_cast<uint64_t>(lanes_); }
  void begin(int lane, const ImageView& black);
  void serve();
  void work(Frame& frame, uint64_t number);
  void skip_frame();
  void watch_rig(FrameReport& report, Slot& slot);
  void follow();
  std::shared_ptr<const RectifyStage> corrected_stage(const PoseVector& correction);

  const std::shared_ptr<FramePath> path_;
  const std::shared_ptr<Session> session_;
  const std::shared_ptr<const Rig> rig_;
  const std::shared_ptr<const Identity> identity_;
  const int lanes_;
  const Size size_;     // of the frames
  const Size picture_;  // that the network sees
  Turns turns_;
  TemporalFilter filter_;  // who has the turn has it

  std::mutex mutex_;  // guards what follows
  std::condition_variable change_;
  std::vector<Frame> frames_;  // one more than lanes: the pictures of the frame that was received last stay
  int begun_ = 0;           // threads that were handed to the host, and have computed a frame
  std::exception_ptr failure_;  // of one of these frames
  bool temporal_ = false;
  uint64_t submitted_ = 0;
  uint64_t started_ = 0;
  uint64_t received_ = 0;
  bool ended_ = false;   // nothing more is submitted
  bool closed_ = false;  // nothing more is computed
  std::shared_ptr<const RectifyStage> stage_;
  RigWatch watch_;
  int corrected_at_ = 0;  // measured frames at the latest correction
  bool following_ = false;                // the follower was handed to the host, and waits for corrections
  std::optional<PoseVector> correction_;  // that the follower shall make, or is making
  Clock::time_point available_;           // when the frame that was received last could be: it and all before it were done
  std::vector<std::thread> threads_;
  std::thread follower_;  // computes new rectifications; none where the rig is not followed
};

}  // namespace endosdk
