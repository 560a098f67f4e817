// Watches a rig over the frames of one source: its rotation, whether both views are taken at the same time, and whether frames
// repeat.
#pragma once

#include "frame_path/frame.hpp"
#include "frame_path/frozen.hpp"
#include "frame_path/simultaneity.hpp"
#include "frame_path/slot.hpp"
#include "geometry/pose_filter.hpp"

namespace endosdk {

class RigWatch {
 public:
  // Reserves memory for frames of the slot's size.
  void make_room(Slot& slot) { simultaneity_.make_room(slot.brightness()); }

  // Takes the next frame, and completes its report. Frames must come in their order.
  void add(FrameReport& report, Slot& slot);

  // A frame has no report: the next one does not follow the last one.
  void skip() { simultaneity_.skip(); }

  // Number of frames since the start whose rotation was measured.
  int frames() const { return pose_.frames(); }

 private:
  PoseFilter pose_;
  Simultaneity simultaneity_;
  Frozen frozen_;
};

}  // namespace endosdk
