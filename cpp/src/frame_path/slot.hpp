// What one frame in work needs: its pictures, the network tied to them, and the memory of every stage.
#pragma once

#include <memory>
#include <mutex>

#include "frame_path/cancelling.hpp"
#include "frame_path/frame.hpp"
#include "frame_path/rectify_stage.hpp"
#include "frame_path/session.hpp"
#include "maps/coarse_match.hpp"
#include "maps/image_motion.hpp"
#include "maps/maps.hpp"
#include "maps/postprocess.hpp"
#include "maps/temporal_filter.hpp"

namespace endosdk {

// What counts as an answer.
struct Limits {
  double min_confidence = 0.0;
  double min_depth_mm = 0.0;
  double max_depth_mm = 0.0;
  double depth_unit_mm = 0.0;  // one step of the 16-bit depth map
};

class Slot {
 public:
  Slot(std::shared_ptr<const RectifyStage> stage, std::shared_ptr<Session> session);
  Slot(const Slot&) = delete;
  Slot& operator=(const Slot&) = delete;

  const RectifyStage& stage() const { return *stage_; }
  const std::shared_ptr<const RectifyStage>& shared_stage() const { return stage_; }

  // Another rectification to pictures of the same size.
  void use(std::shared_ptr<const RectifyStage> stage) { stage_ = std::move(stage); }

  // Writes the pictures that the network reads; the frames are not needed afterwards. Adds the time to the report.
  void rectify(const FramePair& pair, FrameReport& report);

  // Runs the network.
  void infer(Work& work, FrameReport& report);

  // Draws the network's disparity towards that of the frame before. The calls of one filter come in the order of frames.
  void steady(TemporalFilter& filter, FrameReport& report);

  // Fills the maps from what the network said; those that nobody wants are null.
  void answer(const MapsOut& wanted, const Limits& limits, const Rig* rig, Work& work, FrameReport& report);

  // Of the left picture of the latest answer; it may be exchanged for another one.
  BrightnessPyramid& brightness() { return brightness_; }

  // Copies of the pictures, as tight RGB rows; null: not wanted.
  void copy_pictures(uint8_t* left, uint8_t* right);

 private:
  int postprocess(const MapsOut& maps, const Limits& limits, const Rig* rig);

  // Sets what the pictures and the maps of the latest frame tell of its causes.
  void judge(const MapsOut& maps, FrameReport& report);
  void judge_rig(FrameReport& report) const;
  void explain_failure(bool failed, FrameReport& report);

  std::shared_ptr<const RectifyStage> stage_;
  std::shared_ptr<Session> session_;
  const ModelInfo& model_;
  std::mutex pictures_;  // held while they are written or copied
  SessionBuffers buffers_;
  std::unique_ptr<Session::Run> run_;
  SpareMaps spare_;
  RectifyScratch rectify_scratch_;
  PostprocessScratch scratch_;
  CoarseMatch coarse_match_;
  BrightnessPyramid brightness_;
  bool has_rig_ = false;  // of the latest pair
  double focal_y_ = 0.0;
};

}  // namespace endosdk
