// The whole way of a frame: size choice, rectification, the network, post-processing, counters, deadline and cancel. Both
// faces, C and Python, stand on it; each brings its own session.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "frame_path/cancelling.hpp"
#include "frame_path/counters.hpp"
#include "frame_path/settings.hpp"
#include "frame_path/slot.hpp"
#include "platform/fair_lock.hpp"
#include "platform/json.hpp"

namespace endosdk {

class Stream;

class FramePath : public std::enable_shared_from_this<FramePath> {
 public:
  FramePath(std::shared_ptr<Session> session, FramePathSettings settings);

  const ModelInfo& model() const { return session_->model(); }
  const FramePathSettings& settings() const { return settings_; }

  void set_calibration(std::optional<Rig> rig);
  std::shared_ptr<const Rig> calibration() const;

  // Depth, mm, of a surface at the end of the range that the network finds; NaN without a calibration or where the model
  // does not state its range.
  double nearest_depth_mm() const;

  // Reserves what frames of this size need and runs once.
  void prepare(Size frame);
  FrameReport predict(const FramePair& pair, const MapsOut& wanted);

  // Frames of one size, several in flight. The stream keeps the frame path alive.
  std::unique_ptr<Stream> stream(Size frame);

  // The pair at its own size, as tight RGB rows: what the maps lie over. `capacity` is in bytes per view.
  void rectify(const FramePair& pair, uint8_t* left, uint8_t* right, size_t capacity);

  // Copies of the latest pair as the network saw it.
  Size rectified_size();
  void rectified(uint8_t* left, uint8_t* right, size_t capacity);

  void cancel() { cancelling_.cancel_all(); }
  void self_test();

  // Waits for the call that runs. Later ones are refused.
  void close();

  // Versions, model, settings and counters; it waits for no frame.
  JsonObject diagnostics() const;

 private:
  friend class Stream;

  // The size at which the network sees such frames.
  Size network_size(Size frame) const;
  void check_open() const;
  const std::shared_ptr<Slot>& prepared(Size frame, const Work& work);
  FrameReport compute(const FramePair& pair, const MapsOut& wanted, Clock::time_point asked);
  void finish(FrameReport& report, Clock::time_point asked) const;
  void count(FrameReport& report, std::shared_ptr<Slot> slot);
  std::shared_ptr<Session> session_of_streams();

  const FramePathSettings settings_;
  const std::shared_ptr<Session> session_;
  mutable Cancelling cancelling_;
  Counters counters_;

  FairLock calls_;  // held by every call but cancel, reports and those of streams
  std::shared_ptr<Slot> slot_;
  std::shared_ptr<const RectifyStage> full_;
  std::shared_ptr<Session> one_thread_each_;

  mutable std::mutex state_;  // guards what follows
  std::shared_ptr<const Rig> rig_;
  std::shared_ptr<Slot> latest_;  // its pictures belong to the latest finished frame
  std::optional<Size> picture_;
  bool closed_ = false;
};

}  // namespace endosdk
