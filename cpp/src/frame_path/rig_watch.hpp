// What the frames of one source tell together of the rig that took them: its turn, whether its views are of one moment, and
// whether they repeat.
#pragma once

#include "frame_path/frame.hpp"
#include "frame_path/frozen.hpp"
#include "frame_path/simultaneity.hpp"
#include "frame_path/slot.hpp"
#include "geometry/pose_filter.hpp"

namespace endosdk {

class RigWatch {
 public:
  // Reserves what it needs for frames of the slot's size.
  void make_room(Slot& slot) { simultaneity_.make_room(slot.brightness()); }

  // Takes the frames in their order, and completes their reports.
  void add(FrameReport& report, Slot& slot);

  // Frames whose turn was measured since the start.
  int frames() const { return pose_.frames(); }

 private:
  PoseFilter pose_;
  Simultaneity simultaneity_;
  Frozen frozen_;
};

}  // namespace endosdk
