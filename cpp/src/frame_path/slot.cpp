#include "frame_path/slot.hpp"

#include <algorithm>
#include <cmath>

#include "images/same_view.hpp"
#include "maps/same_view_matches.hpp"
#include "maps/reasons.hpp"

namespace endosdk {
namespace {

FloatView read_only(const MutableFloatView& view) { return {view.data, view.width, view.height}; }

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

// Without a rig, a usual focal length is assumed. The pattern fits as well, but its angles mean nothing.
PosePattern pattern_of(const Rig* rig, Size frame, double right_shift) {
  if (rig == nullptr) return {1.0 * frame.width, 1.0 * frame.width, 0.5 * (frame.width - 1), 0.5 * (frame.height - 1), 0.0, false};
  const RectifiedGeometry& g = rig->geometry();
  return {g.focal_px(), g.focal_y_px(), g.cx(), g.cy(), g.doffs() - right_shift, true};
}

}  // namespace

Slot::Slot(std::shared_ptr<const RectifyStage> stage, std::shared_ptr<Session> session)
    : stage_(std::move(stage)),
      session_(std::move(session)),
      model_(session_->model()),
      buffers_(stage_->picture(), model_),
      run_(session_->bind(buffers_)),
      spare_(count_of(stage_->frame())) {}

void Slot::rectify(const FramePair& pair, FrameReport& report) {
  const std::lock_guard lock(pictures_);
  const Clock::time_point started = Clock::now();
  (*stage_)(pair.left, pair.right, buffers_.left(), buffers_.right(), pair.order, rectify_scratch_);
  const Clock::time_point rectified = Clock::now();
  const FrameDisplacement apart = displacement_of_frames(pair.left, pair.right);
  report.causes.set(Cause::same_view_twice, apart.textured);
  rest_apart_ = apart.rest;
  equal_.compare(pair.left, pair.right);
  report.prints = {print_of(pair.left), print_of(pair.right)};
  report.corrected = stage_->corrected();
  const Clock::time_point ended = Clock::now();
  report.trust_ms = milliseconds(rectified, ended);
  report.rectify_ms += milliseconds(started, ended);
}

void Slot::infer(Work& work, FrameReport& report) {
  const Clock::time_point started = Clock::now();
  work.run(*run_);
  report.session_ms = milliseconds(started, Clock::now());
}

void Slot::smooth_over_time(TemporalFilter& filter, FrameReport& report) {
  const Clock::time_point started = Clock::now();
  const double per_pixel = 1.0 / model_.output_stride;
  filter.smooth({buffers_.left(), stage_->picture(), buffers_.disparity(), read_only(buffers_.confidence()), {per_pixel, per_pixel}});
  report.postprocess_ms += milliseconds(started, Clock::now());
}

void Slot::answer(const MapsOut& wanted, const Limits& limits, const Rig* rig, Work& work, FrameReport& report) {
  const Clock::time_point started = Clock::now();
  const MapsOut maps = spare_.complete(wanted);
  const int valid = postprocess(maps, limits, rig);
  report.valid_share = valid / static_cast<double>(count_of(stage_->frame()));
  const Clock::time_point filled = Clock::now();
  judge(maps, rig, report);
  brightness_.read(buffers_.left(), stage_->picture());
  report.trust_ms += scratch_.trust_ms + milliseconds(filled, Clock::now());
  if (report.causes.status() == Quality::invalid) {
    withdraw_answer(maps, count_of(stage_->frame()));
    report.valid_share = 0.0;
  }
  write_u16(maps, count_of(stage_->frame()), limits.depth_unit_mm);
  work.check();
  report.postprocess_ms += milliseconds(started, Clock::now());
}

void Slot::judge(const MapsOut& maps, const Rig* rig, FrameReport& report) {
  const double seen = scratch_.views.size().width > 0 ? share_of_scene(scratch_.views, scratch_.overlays) : 1.0;
  report.causes.set(Cause::few_valid, report.valid_share / seen);
  report.causes.set(Cause::out_of_range, share_out_of_range(maps.reasons, count_of(stage_->frame())) / seen);
  if (scratch_.views.size().width == 0) return;  // the picture is too small to be judged
  report.causes.set(Cause::views_differ, scratch_.views.most_correlation());
  report.causes.set(Cause::low_texture, std::fmin(scratch_.views.textured_share(), scratch_.measures.textured()));
  report.causes.set(Cause::covered, scratch_.measures.covered());
  report.causes.set(Cause::saturated, scratch_.measures.saturated());
  report.causes.set(Cause::blurred, scratch_.measures.blur());
  report.causes.set(Cause::dim, scratch_.measures.level());
  report.causes.set(Cause::repeated_pattern, scratch_.rivals);
  judge_same_view(rig, report);
  judge_rig(report);
  if (report.causes.raised(Cause::same_view_twice)) return;
  const bool failed = report.causes.raised(Cause::views_differ) || report.causes.raised(Cause::few_valid);
  // A network with a fine grid finds matches even if the rows are far off. But no rotation can be measured from them.
  if (failed || !report.pose.measured) explain_failure(failed, report);
}

// The frames were compared before the network ran. If they only share an overlay, the rest of the frames differs, and the matches
// of the scene are not those of one picture. Frames that are rectified first have other matches than the network can find. There,
// the rest of the frames decides alone.
void Slot::judge_same_view(const Rig* rig, FrameReport& report) const {
  if (!report.causes.raised(Cause::same_view_twice) || rest_apart_ < displacement_of_one_view) return;
  const Size picture = stage_->picture();
  const bool rectifies = rig != nullptr && !rig->is_rectified();
  const double shift = stage_->right_shift() * picture.width / stage_->frame().width;
  const bool only_overlay = rectifies ? rest_apart_ > rest_of_one_view
                                      : matches_from_one_picture(scratch_.views, picture, shift) > one_picture_matches;
  if (only_overlay) report.causes.set(Cause::same_view_twice, rest_apart_);
}

void Slot::explain_failure(bool failed, FrameReport& report) {
  coarse_match_.measure(scratch_.search, scratch_.views);
  if (failed) report.causes.set(Cause::swapped, coarse_match_.exchanged_gain());
  const bool swapped = report.causes.raised(Cause::swapped);
  const double row = 2.0 * scratch_.views.unit() * stage_->frame().height / stage_->picture().height;
  const double rows_off = std::abs(row * coarse_match_.rows_off());
  // The fit searches only near each match. If the rows are far off, it finds only a part of the offset, or a chance similarity.
  const bool missed = report.pose.measured && report.pose.vertical_px < least_found * rows_off;
  if (swapped || missed || report.causes.raised(Cause::views_differ)) {
    report.pose = {};
    for (const Cause measured : {Cause::rig_moved, Cause::not_rectified, Cause::scales_differ}) report.causes.set(measured, never);
  }
  if (swapped || report.pose.measured) return;
  report.causes.set(Cause::not_rectified, rows_off);
  if (!has_rig_) return;
  // In a rectified rig, only a rotation about x moves all matches by nearly the same number of rows: by focal_y * (1 + v * v)
  // times the angle, at height v.
  const double height = stage_->frame().height / focal_y_;
  report.causes.set(Cause::rig_moved, degrees_per_radian * rows_off / (focal_y_ * (1.0 + height * height / 12.0)));
}

void Slot::judge_rig(FrameReport& report) const {
  report.calibrated = has_rig_;
  if (has_rig_) report.causes.set_focal(focal_x_ / stage_->frame().width);
  report.pose = scratch_.rows.latest();
  if (!report.pose.measured) return;
  const PoseError& pose = report.pose;
  report.causes.set(Cause::scales_differ, 100.0 * std::abs(pose.certain_scale()));
  if (has_rig_) report.causes.set(Cause::rig_moved, degrees_per_radian * turn_length(pose.certain_turns()));
  if (report.causes.raised(Cause::rig_moved)) return;
  // Rows may differ although no rotation is certain, for example if a lens is not as it was calibrated.
  report.causes.set(Cause::not_rectified, pose.vertical_px > certain_errors * pose.vertical_se_px ? pose.vertical_px : 0.0);
}

int Slot::postprocess(const MapsOut& maps, const Limits& limits, const Rig* rig) {
  const Size frame = stage_->frame();
  const Size picture = stage_->picture();
  PostprocessInput in;
  in.size = frame;
  in.disparity = read_only(buffers_.disparity());
  in.confidence = read_only(buffers_.confidence());
  // The scales relate to the picture without its padding; the grids include the padding.
  in.view_scale = {static_cast<double>(picture.height) / frame.height, static_cast<double>(picture.width) / frame.width};
  in.scale = {in.view_scale.y / model_.output_stride, in.view_scale.x / model_.output_stride};
  in.gain = static_cast<float>(static_cast<double>(frame.width) / picture.width);
  in.reach = picture.width / confidence_parts;
  in.min_confidence = static_cast<float>(limits.min_confidence);
  in.max_candidate_disparity = model_.max_candidate_disparity;
  in.upsampling = model_.upsampling;
  in.left = buffers_.left();
  in.right = buffers_.right();
  in.fields = stage_->fields();
  in.equal = &equal_;
  in.blocks = &stage_->blocks();
  in.right_shift = stage_->right_shift();
  in.valid_left = stage_->valid_left();
  in.valid_right = stage_->valid_right();
  has_rig_ = rig != nullptr;
  in.pattern = pattern_of(rig, frame, stage_->right_shift());
  focal_x_ = in.pattern.focal_x;
  focal_y_ = in.pattern.focal_y;
  if (rig != nullptr) {
    const RectifiedGeometry& g = rig->geometry();
    in.geometry = {g.focal_px(), g.baseline_mm(), g.doffs(), limits.min_depth_mm, limits.max_depth_mm};
  }
  return endosdk::postprocess(in, maps, scratch_);
}

void Slot::copy_pictures(uint8_t* left, uint8_t* right) {
  const std::lock_guard lock(pictures_);
  copy_interleaved(buffers_.left(), stage_->picture(), left);
  copy_interleaved(buffers_.right(), stage_->picture(), right);
}

}  // namespace endosdk
