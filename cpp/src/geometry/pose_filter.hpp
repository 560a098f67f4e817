// The pose error of a rig over a sequence of frames. Each frame counts by its own certainty, and older frames fade.
#pragma once

#include <optional>

#include "geometry/pose_error.hpp"

namespace endosdk {

class PoseFilter {
 public:
  // Adds a frame. `corrected` is the part of the error that its rectification already corrected. A frame without a measurement
  // changes nothing. `new_view`: it shows other tissue than the frames before, or the same from elsewhere.
  void add(const PoseError& error, const PoseVector& corrected, bool new_view);

  // The pose error against the calibration, without corrections. It is not measured before the first frame.
  const PoseError& value() const { return value_; }

  // Number of measured frames since the start.
  int frames() const { return frames_; }

 private:
  struct Evidence {
    PoseMatrix information{};
    PoseVector pull{};

    void add(const Evidence& other, double counts);
    void fade(double factor);
  };

  Evidence former_views_;
  Evidence view_;  // of the frames of the present view
  PoseError value_;
  int frames_ = 0;
};

// A rig has drifted if it certainly rotated, and by more than a harmless angle.
bool has_drifted(const PoseError& steady);

// The next correction of the rectification, at most a tenth of a degree from the one before. None if no improvement is certain.
std::optional<PoseVector> next_correction(const PoseVector& before, const PoseError& steady);

}  // namespace endosdk
