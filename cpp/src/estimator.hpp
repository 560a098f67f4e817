// The whole frame path of one camera: it owns the model and the memory, and turns pairs of frames into maps.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "latency.hpp"
#include "maps.hpp"
#include "postprocess.hpp"
#include "rectify_stage.hpp"
#include "rig.hpp"
#include "session.hpp"

namespace endosdk {

struct EstimatorSettings {
  std::string runtime_library;  // empty: search
  SessionSettings session;
  std::optional<Size> network;
  double min_confidence = 0.0;
  double min_depth_mm = 0.0;
  double max_depth_mm = 0.0;
  double depth_unit_mm = 0.0;
  double deadline_ms = 0.0;  // 0: none
  Log log;
};

struct FramePair {
  ImageView left;
  ImageView right;
  ChannelOrder order = ChannelOrder::rgb;
};

struct FrameReport {
  uint64_t frame = 0;
  double valid_share = 0.0;
  double rectify_ms = 0.0;
  double session_ms = 0.0;
  double postprocess_ms = 0.0;
  bool late = false;
};

class Estimator {
 public:
  Estimator(const ModelFile& model, EstimatorSettings settings);

  void set_calibration(std::optional<Rig> rig);
  std::optional<Rig> calibration() const;

  void prepare(Size frame);
  FrameReport predict(const FramePair& pair, const MapsOut& wanted);

  // Copies of the latest pair as the network saw it; `capacity` is in bytes per view.
  void rectified(uint8_t* left, uint8_t* right, size_t capacity) const;

  void cancel();
  void self_test();
  std::string diagnostics() const;

 private:
  // Everything whose size follows from that of the frames.
  struct Frames {
    RectifyStage stage;
    Session::Buffers buffers;
    SpareMaps spare;
    RectifyScratch rectify_scratch;
    PostprocessScratch scratch;

    size_t pixels() const { return static_cast<size_t>(stage.frame().width) * static_cast<size_t>(stage.frame().height); }
  };
  class Running;

  void make_frames(Size frame, const Running& running);
  FrameReport compute(const FramePair& pair, const MapsOut& maps, const Running& running);
  int postprocess_frame(const MapsOut& maps, bool same_frames);
  void count(FrameReport& report);
  double nearest_depth_mm() const;  // before the end of the model's range; NaN where that is not known

  mutable std::mutex calls_;  // held by every call but cancel
  std::mutex cancelling_;     // guards the two flags below
  bool running_ = false;
  bool cancelled_ = false;

  EstimatorSettings settings_;
  Session session_;
  std::optional<Rig> rig_;
  std::unique_ptr<Frames> frames_;
  bool has_picture_ = false;  // the buffers hold a pair that was predicted
  LatencyHistogram latency_;
  uint64_t late_ = 0;
  uint64_t mismatched_ = 0;
  uint64_t failed_ = 0;
};

}  // namespace endosdk
