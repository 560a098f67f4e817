#include "frame_path/frame_judgement.hpp"

#include <algorithm>
#include <cmath>

#include "images/same_view.hpp"
#include "maps/same_view_matches.hpp"

namespace endosdk {
namespace {

// Share of all pixels that are out of range; pixels that one view does not show are not counted. The inner count is one byte,
// over so few pixels that it cannot overflow, so that the compiler uses whole vectors of bytes.
double share_out_of_range(const uint8_t* reasons, size_t count) {
  constexpr uint8_t looked_at = ENDO_REASON_OUT_OF_RANGE | ENDO_REASON_OUTSIDE_VIEW | ENDO_REASON_OUTSIDE_OVERLAP;
  constexpr size_t group = 240;
  size_t total = 0;
  for (size_t first = 0; first < count; first += group) {
    const size_t end = std::min(first + group, count);
    uint8_t found = 0;
    for (size_t i = first; i < end; ++i) found = static_cast<uint8_t>(found + ((reasons[i] & looked_at) == ENDO_REASON_OUT_OF_RANGE ? 1 : 0));
    total += found;
  }
  return static_cast<double>(total) / static_cast<double>(count);
}

// Share of the left view that shows the scene; never 0.
double share_of_scene(const MatchedViews& views, const Overlays& overlays) {
  constexpr double least = 0.01;
  return std::max(least, views.field(0).share() - overlays.share());
}

// The fit of the rig is trusted only if it explains at least this share of the rows found without the network.
constexpr double least_found = 0.7;

// The frames were compared before the network ran. If they only share an overlay, the rest of the frames differs, and the matches
// of the scene are not those of one picture. Frames that are rectified first have other matches than the network can find. There,
// the rest of the frames decides alone.
void judge_same_view(const FrameToJudge& frame, FrameReport& report, std::vector<double>& apart) {
  // Before any return, so that frames after the first allocate nothing.
  apart.reserve(count_of(frame.seen.views.size()) / same_view_step);
  if (!report.causes.raised(Cause::same_view_twice) || frame.rest_apart < displacement_of_one_view) return;
  const RectifyStage& stage = frame.stage;
  const Size picture = stage.picture();
  const bool rectifies = frame.rig != nullptr && !frame.rig->is_rectified();
  const double shift = stage.right_shift() * picture.width / stage.frame().width;
  const bool only_overlay = rectifies ? frame.rest_apart > rest_of_one_view
                                      : matches_from_one_picture(frame.seen.views, picture, shift, apart) > one_picture_matches;
  if (only_overlay) report.causes.set(Cause::same_view_twice, frame.rest_apart);
}

void judge_rig(const FrameToJudge& frame, FrameReport& report) {
  report.calibrated = frame.rig != nullptr;
  if (report.calibrated) report.causes.set_focal(frame.pattern.focal_x / frame.stage.frame().width);
  report.pose = frame.seen.rows.latest();
  if (!report.pose.measured) return;
  const PoseError& pose = report.pose;
  report.causes.set(Cause::distorted, frame.seen.rows.misfit().share());
  report.causes.set(Cause::scales_differ, 100.0 * std::abs(pose.certain_scale()));
  if (report.calibrated) report.causes.set(Cause::rig_moved, degrees_per_radian * turn_length(pose.certain_turns()));
  if (report.causes.raised(Cause::rig_moved)) return;
  // Rows may differ although no rotation is certain, for example if a lens is not as it was calibrated.
  report.causes.set(Cause::not_rectified, pose.vertical_px > certain_errors * pose.vertical_se_px ? pose.vertical_px : 0.0);
}

}  // namespace

void FrameJudgement::judge(const FrameToJudge& frame, FrameReport& report) {
  const PostprocessScratch& seen = frame.seen;
  const double scene = seen.views.size().width > 0 ? share_of_scene(seen.views, seen.overlays) : 1.0;
  report.causes.set(Cause::few_valid, report.valid_share / scene);
  report.causes.set(Cause::out_of_range, share_out_of_range(frame.reasons, count_of(frame.stage.frame())) / scene);
  if (seen.views.size().width == 0) return;  // the picture is too small to be judged
  report.causes.set(Cause::views_differ, seen.views.most_correlation());
  report.causes.set(Cause::low_texture, std::fmin(seen.views.textured_share(), seen.measures.textured()));
  report.causes.set(Cause::covered, seen.measures.covered());
  report.causes.set(Cause::saturated, seen.measures.saturated());
  report.causes.set(Cause::blurred, seen.measures.blur());
  report.causes.set(Cause::dim, seen.measures.level());
  report.causes.set(Cause::repeated_pattern, seen.rivals);
  judge_same_view(frame, report, apart_);
  judge_rig(frame, report);
  if (report.causes.raised(Cause::same_view_twice)) return;
  const bool failed = report.causes.raised(Cause::views_differ) || report.causes.raised(Cause::few_valid);
  // A network with a fine grid finds matches even if the rows are far off. But no rotation can be measured from them.
  if (failed || !report.pose.measured) explain_failure(frame, failed, report);
}

void FrameJudgement::explain_failure(const FrameToJudge& frame, bool failed, FrameReport& report) {
  coarse_match_.measure(frame.seen.search, frame.seen.views);
  if (failed) report.causes.set(Cause::swapped, coarse_match_.exchanged_gain());
  const bool swapped = report.causes.raised(Cause::swapped);
  const double row = 2.0 * frame.seen.views.unit() * frame.stage.frame().height / frame.stage.picture().height;
  const double rows_off = std::abs(row * coarse_match_.rows_off());
  // The fit searches only near each match. If the rows are far off, it finds only a part of the offset, or a chance similarity.
  const bool missed = report.pose.measured && report.pose.vertical_px < least_found * rows_off;
  if (swapped || missed || report.causes.raised(Cause::views_differ)) {
    report.pose = {};
    for (const Cause measured : {Cause::rig_moved, Cause::not_rectified, Cause::scales_differ, Cause::distorted}) report.causes.set(measured, never);
  }
  if (swapped || report.pose.measured) return;
  report.causes.set(Cause::not_rectified, rows_off);
  if (frame.rig == nullptr) return;
  // In a rectified rig, only a rotation about x moves all matches by nearly the same number of rows: by focal_y * (1 + v * v)
  // times the angle, at height v.
  const double focal_y = frame.pattern.focal_y;
  const double height = frame.stage.frame().height / focal_y;
  report.causes.set(Cause::rig_moved, degrees_per_radian * rows_off / (focal_y * (1.0 + height * height / 12.0)));
}

}  // namespace endosdk
