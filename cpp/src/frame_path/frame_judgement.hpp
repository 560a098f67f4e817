// What is wrong with a frame: the causes that follow from its pictures and maps.
#pragma once

#include <cstdint>

#include "frame_path/frame.hpp"
#include "frame_path/rectify_stage.hpp"
#include "geometry/rig.hpp"
#include "maps/coarse_match.hpp"
#include "maps/postprocess.hpp"

namespace endosdk {

// What is judged: one frame after post-processing.
struct FrameToJudge {
  PostprocessScratch& seen;  // what post-processing measured
  const RectifyStage& stage;
  const Rig* rig;              // null: no calibration
  const PosePattern& pattern;  // of the rig, or of an assumed one
  double rest_apart;           // of the raw frames, see FrameDisplacement
  const uint8_t* reasons;      // of all pixels
};

class FrameJudgement {
 public:
  // Sets causes, pose and `calibrated` of the report, which has its share of valid pixels and what rectification found.
  void judge(const FrameToJudge& frame, FrameReport& report);

 private:
  void explain_failure(const FrameToJudge& frame, bool failed, FrameReport& report);

  CoarseMatch coarse_match_;
  std::vector<double> apart_;  // disparities of matches
};

}  // namespace endosdk
