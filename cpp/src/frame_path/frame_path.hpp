// The whole way of a frame: size choice, rectification, the network, post-processing, counters, deadline and cancel. Both
// faces, C and Python, stand on it; each brings its own session.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "frame_path/cancelling.hpp"
#include "frame_path/counters.hpp"
#include "frame_path/rig_watch.hpp"
#include "frame_path/self_test.hpp"
#include "frame_path/sessions.hpp"
#include "frame_path/settings.hpp"
#include "frame_path/slot.hpp"
#include "platform/fair_lock.hpp"
#include "platform/json.hpp"
#include "platform/own_process.hpp"

namespace endosdk {

class Stream;

class FramePath : public std::enable_shared_from_this<FramePath> {
 public:
  // On an accelerator the session for the usual size is made here: what the provider has to say comes with the opening.
  FramePath(std::shared_ptr<Session> session, FramePathSettings settings);

  const ModelInfo& model() const { return model_; }
  const FramePathSettings& settings() const { return settings_; }

  // Logs the nearest depth that the model sees on the rig.
  void set_calibration(std::optional<Rig> rig);
  std::shared_ptr<const Rig> calibration() const;

  // Largest disparity that counts as an answer in frames of this size, px; NaN where the model does not state its range.
  double largest_disparity(Size frame) const;

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

  void cancel() {
    process_.check();
    cancelling_.cancel_all();
  }

  // Checks the answers to built-in pairs: to a plane at the size of the frames and, of a shipped model, to the golden one.
  void self_test();

  // From which the golden answers are written.
  CellsOfAnswer cells_of_answer();

  // The process it was made in. Every call in a forked child is refused, before it could wait for ever.
  const OwnProcess& process() const { return process_; }

  // Waits for the call that runs. Later ones are refused. Streams take no further frame; those in flight can be received.
  void close();

  // Of the frames that are computed from now on.
  std::shared_ptr<const Identity> identity() const;

  // Versions, model, settings and counters; it waits for no frame.
  JsonObject diagnostics() const;

 private:
  friend class Stream;

  // Largest disparity that the network finds in frames of this size, px of the views as it sees them.
  double network_reach(Size frame) const;

  // The size at which the network sees such frames, and pictures where there is no frame.
  Size network_size(Size frame) const;
  Size usual_size() const;
  void check_open() const;
  void check_stamp(const FramePair& pair) const;
  const std::shared_ptr<Slot>& prepared(Size frame, const Work& work);
  void use(std::shared_ptr<Slot> slot);
  void keep_calibration(std::shared_ptr<const Rig> rig);
  double nearest_depth_mm(const Rig* rig) const;
  FrameReport compute(const FramePair& pair, const MapsOut& wanted, Work& work);
  void compute_in(Slot& slot, const FramePair& pair, const MapsOut& wanted, Work& work, FrameReport& report);
  void finish(FrameReport& report, Clock::duration taken) const;
  void judge_age(FrameReport& report) const;
  void hand_out(FrameReport& report);
  void log_faults(const FrameReport& report) const;
  void keep_latest(std::shared_ptr<Slot> slot);
  void tell_correction(const PoseVector& corrected) const;
  void add_stream(Stream* stream);
  void remove_stream(Stream* stream);

  const OwnProcess process_;
  const FramePathSettings settings_;
  const ModelInfo model_;
  mutable Cancelling cancelling_;
  Counters counters_;

  FairLock calls_;  // held by every call but cancel, reports and those of streams
  Sessions sessions_;
  std::shared_ptr<Slot> slot_;
  RigWatch watch_;  // of frames outside streams
  std::optional<RowsOfPairs> full_;  // what `rectify` needs

  std::mutex streams_mutex_;
  std::set<Stream*> streams_;  // that are open

  mutable std::mutex state_;  // guards what follows
  std::shared_ptr<const Rig> rig_;
  std::shared_ptr<const Identity> identity_;
  std::shared_ptr<Slot> latest_;  // its pictures belong to the latest finished frame
  std::optional<Size> picture_;  // of the size that was asked for last
  bool closed_ = false;
};

}  // namespace endosdk
