// A slot for one frame in work: its pictures, the network bound to them, and the memory of every stage.
#pragma once

#include <memory>
#include <mutex>

#include "frame_path/cancelling.hpp"
#include "frame_path/frame.hpp"
#include "frame_path/frame_judgement.hpp"
#include "frame_path/limits.hpp"
#include "frame_path/rectify_stage.hpp"
#include "frame_path/session.hpp"
#include "images/equal_blocks.hpp"
#include "maps/image_motion.hpp"
#include "maps/maps.hpp"
#include "maps/postprocess.hpp"
#include "maps/temporal_filter.hpp"

namespace endosdk {

class Slot {
 public:
  Slot(std::shared_ptr<const RectifyStage> stage, std::shared_ptr<Session> session);
  Slot(const Slot&) = delete;
  Slot& operator=(const Slot&) = delete;

  const RectifyStage& stage() const { return *stage_; }
  const std::shared_ptr<const RectifyStage>& shared_stage() const { return stage_; }

  // Uses another rectification, to pictures of the same size.
  void use(std::shared_ptr<const RectifyStage> stage) { stage_ = std::move(stage); }

  // Writes the pictures that the network reads. The frames are not needed afterwards. Adds its time to the report.
  void rectify(const FramePair& pair, FrameReport& report);

  // Runs the network.
  void infer(Work& work, FrameReport& report);

  // Applies the temporal filter to the network's disparity. One filter must get the frames in their order.
  void smooth_over_time(TemporalFilter& filter, FrameReport& report);

  // Computes the maps from the network's output. Maps that are not wanted are null.
  void answer(const MapsOut& wanted, const Limits& limits, const Rig* rig, Work& work, FrameReport& report);

  // The brightness of the left picture of the latest answer. The caller may swap it with another pyramid.
  BrightnessPyramid& brightness() { return brightness_; }

  // Copies the pictures as contiguous RGB rows; null: not wanted.
  void copy_pictures(uint8_t* left, uint8_t* right);

 private:
  int postprocess(const MapsOut& maps, const Limits& limits, const Rig* rig, const PosePattern& pattern);

  std::shared_ptr<const RectifyStage> stage_;
  std::shared_ptr<Session> session_;
  const ModelInfo& model_;
  std::mutex pictures_;  // held while the pictures are written or copied
  SessionBuffers buffers_;
  std::unique_ptr<Session::Run> run_;
  SpareMaps spare_;
  RectifyScratch rectify_scratch_;
  EqualBlocks equal_;
  PostprocessScratch scratch_;
  FrameJudgement judgement_;
  BrightnessPyramid brightness_;
  double rest_apart_ = 0.0;  // of the latest pair, see FrameDisplacement
};

}  // namespace endosdk
