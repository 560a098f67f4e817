// The causes that say what is wrong with a frame: one stable list, a measure for each cause, and the table from which the
// frame's status follows. The numbers are those of the public header.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <endosdk/endosdk.h>
#include "images/same_view.hpp"
#include "maps/photometric_consistency.hpp"
#include "maps/row_misfit.hpp"

namespace endosdk {

// The numbers are shared with C and Python, and never change.
enum class Quality : int { ok = ENDO_QUALITY_OK, degraded = ENDO_QUALITY_DEGRADED, invalid = ENDO_QUALITY_INVALID };

enum class Cause : int {
  covered = ENDO_CAUSE_COVERED,
  saturated = ENDO_CAUSE_SATURATED,
  blurred = ENDO_CAUSE_BLURRED,
  dim = ENDO_CAUSE_DIM,
  frozen = ENDO_CAUSE_FROZEN,
  not_simultaneous = ENDO_CAUSE_NOT_SIMULTANEOUS,
  same_view_twice = ENDO_CAUSE_SAME_VIEW_TWICE,
  swapped = ENDO_CAUSE_SWAPPED,
  not_rectified = ENDO_CAUSE_NOT_RECTIFIED,
  rig_moved = ENDO_CAUSE_RIG_MOVED,
  out_of_range = ENDO_CAUSE_OUT_OF_RANGE,
  low_texture = ENDO_CAUSE_LOW_TEXTURE,
  late = ENDO_CAUSE_LATE,
  views_differ = ENDO_CAUSE_VIEWS_DIFFER,
  few_valid = ENDO_CAUSE_FEW_VALID,
  stale = ENDO_CAUSE_STALE,
  repeated_pattern = ENDO_CAUSE_REPEATED_PATTERN,
  scales_differ = ENDO_CAUSE_SCALES_DIFFER,
  interlaced = ENDO_CAUSE_INTERLACED,
  distorted = ENDO_CAUSE_DISTORTED,
};

constexpr int cause_count = 20;

// Number of measures that fit in the C result; it has room for causes of later releases.
constexpr int most_causes = ENDO_MOST_CAUSES;

constexpr double never = std::numeric_limits<double>::quiet_NaN();

enum class Bad { high, low };

struct CauseFact {
  Cause cause;
  const char* name;
  const char* measure;  // what the measure is, and its unit
  Bad bad;              // which side of the limits is bad
  double degraded;      // the measure from which the frame is degraded
  double invalid;       // the measure from which the frame must not be used; `never`: this cause never makes it invalid
  const char* meaning;
  const char* remedy;
};

constexpr CauseFact cause_facts[] = {
    {Cause::covered, "COVERED", "share of the texture of one view where the other view is flat", Bad::high, 0.25, 0.75,
     "a lens is covered, dirty or without signal", "clean the lens and check cable and light"},
    {Cause::saturated, "SATURATED", "share of a view that is overexposed", Bad::high, 0.15, 0.75,
     "glare or too much light", "lower the light or the exposure"},
    {Cause::blurred, "BLURRED", "blur of the softer view against the other one, thousandths of the width", Bad::high, 2.8, never,
     "one view is out of focus or dirty", "clean the lens and focus both cameras"},
    {Cause::dim, "DIM", "mean grey level of the darker view", Bad::low, 16.0, never, "there is too little light",
     "raise the light or the exposure"},
    {Cause::frozen, "FROZEN", "unchanged frames in a row, counted from the 5th if one view is unchanged, from the 25th if both are", Bad::high, 1.0, never,
     "a camera or a grabber repeats an old image", "restart the source of the frames"},
    {Cause::not_simultaneous, "NOT_SIMULTANEOUS", "vertical motion between the views, px of the frame", Bad::high, 0.5, never,
     "the two views were taken at different times", "synchronise the two cameras"},
    {Cause::same_view_twice, "SAME_VIEW_TWICE", "how far apart the views show their texture, thousandths of the width, at most 100",
     Bad::low, displacement_of_one_view, displacement_of_one_view, "one camera is connected to both inputs", "connect each camera to its own input"},
    {Cause::swapped, "SWAPPED", "how much better the views agree when they are swapped", Bad::high, 0.15, 0.15,
     "the right camera is connected to the left input", "swap the two inputs"},
    {Cause::not_rectified, "NOT_RECTIFIED", "vertical disparity, px of the frame", Bad::high, 2.0, 8.0,
     "the rows of the two views do not correspond", "give the calibration of this rig, or rectify the frames"},
    {Cause::rig_moved, "RIG_MOVED", "rotation of the rig against its calibration, degrees", Bad::high, 0.25, 5.0,
     "the cameras have moved since they were calibrated", "calibrate the rig again"},
    {Cause::out_of_range, "OUT_OF_RANGE", "share of the field of view that is out of range", Bad::high, 0.25, never,
     "the surface is too near, too far, or outside the requested depths", "move the endoscope, or choose a model with a larger range"},
    {Cause::low_texture, "LOW_TEXTURE", "share of the field of view with texture beyond noise and even shading", Bad::low, 0.2, least_texture,
     "there is nothing to compare in the images", "raise the light, or look at another place"},
    {Cause::late, "LATE", "time of the frame, as a share of the deadline", Bad::high, 1.0, never,
     "the frame took longer than its deadline", "choose a smaller network size or more threads"},
    {Cause::views_differ, "VIEWS_DIFFER", "upper bound of the mean correlation of the matched views", Bad::low, least_correlation, least_correlation,
     "the two views do not show the same scene", "check wiring, synchronisation and calibration"},
    {Cause::few_valid, "FEW_VALID", "share of the field of view that is valid", Bad::low, 0.5, 0.15,
     "few pixels are valid", "look at the reasons of the pixels"},
    {Cause::stale, "STALE", "age of the pair when its result was returned, as a share of the largest allowed age", Bad::high, 1.0, never,
     "the pair was taken too long ago", "do not show it, and drop queued frames"},
    {Cause::repeated_pattern, "REPEATED_PATTERN", "share of the textured patches that match at two places of their row", Bad::high, 0.5, 0.9,
     "the image repeats itself, so matches may be wrong by whole periods", "look at a place with other texture"},
    {Cause::scales_differ, "SCALES_DIFFER", "by how much one view is larger than the other one, percent", Bad::high, 0.5, never,
     "zoom or focus of the cameras differ", "set the same zoom on both cameras, or calibrate the rig again"},
    {Cause::interlaced, "INTERLACED", "share of the image in which neighbouring rows differ more than rows two apart", Bad::high, 0.1, never,
     "even and odd rows are of two moments", "deinterlace the video, or set the camera to progressive scan"},
    {Cause::distorted, "DISTORTED", "share of the image whose rows differ in a way that no rig explains", Bad::high, distorted_share, never,
     "in a part of the image, one view is bent or of another moment", "clean the lenses, and check the link for lost data"},
};

static_assert(sizeof cause_facts / sizeof cause_facts[0] == cause_count && cause_count <= most_causes);

// With a longer lens, the same rotation of the rig moves the image further. The limit of the table is for lenses up to this focal
// length, in widths. Beyond it, the limit is the rotation that moves the image as far.
constexpr double focal_of_table = 0.42;

// The rotation from which `rig_moved` is raised, degrees, with a lens of this focal length in widths of the frame.
double least_turn(double widths);

// The causes of one frame. A cause that was not measured has the measure NaN, and is not raised.
class Causes {
 public:
  Causes() { measures_.fill(std::numeric_limits<double>::quiet_NaN()); }

  void set(Cause cause, double measure) { measures_[index(cause)] = measure; }
  double measure(Cause cause) const { return measures_[index(cause)]; }
  bool measured(Cause cause) const { return measure(cause) == measure(cause); }

  // Tells the focal length of a calibrated rig, in widths of the frame. The limit of `rig_moved` follows from it.
  void set_focal(double widths);

  // The status that the table gives for this cause alone; ok if it is not raised.
  Quality level(Cause cause) const;
  bool raised(Cause cause) const { return level(cause) != Quality::ok; }

  // The raised causes, each as bit 1 << number.
  uint64_t bits() const;

  // The worst level of all.
  Quality status() const;

 private:
  static constexpr size_t index(Cause cause) { return static_cast<size_t>(cause); }

  std::array<double, cause_count> measures_;
  double least_turn_ = cause_facts[index(Cause::rig_moved)].degraded;  // degrees
};

// The row of the table for a number from C or Python; null if there is no such cause.
const CauseFact* fact_of(int cause);

}  // namespace endosdk
