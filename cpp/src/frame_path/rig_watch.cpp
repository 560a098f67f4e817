#include "frame_path/rig_watch.hpp"

#include <optional>

namespace endosdk {

void RigWatch::add(FrameReport& report, Slot& slot) {
  const Clock::time_point started = Clock::now();
  report.causes.set(Cause::frozen, frozen_.repeats(report.prints));
  const double row_px = static_cast<double>(slot.stage().frame().height) / slot.stage().picture().height;
  const std::optional<double> motion = simultaneity_.motion_between(slot.brightness(), row_px, report.pose);
  if (motion) report.causes.set(Cause::not_simultaneous, *motion);
  if (report.causes.raised(Cause::not_simultaneous)) {
    // The apparent rotation comes from the motion, so its causes are removed. A cause that made the frame invalid stays,
    // because the status follows from it.
    for (const Cause turned : {Cause::rig_moved, Cause::not_rectified, Cause::scales_differ}) {
      if (report.causes.level(turned) != Quality::invalid) report.causes.set(turned, never);
    }
  } else if (!report.causes.raised(Cause::same_view_twice) && !frozen_.one_stands_still()) {
    // What such a pair tells is no rotation of the rig: its rows fit as the rows of one picture do, or as they did long ago.
    pose_.add(report.pose, report.corrected, simultaneity_.new_view());
  }
  report.steady = pose_.value();
  report.trust_ms += milliseconds(started, Clock::now());
}

}  // namespace endosdk
