#include "frame_path/slot.hpp"

#include <array>
#include <cmath>

#include "images/interlacing.hpp"
#include "images/same_view.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

FloatView read_only(const MutableFloatView& view) { return {view.data, view.width, view.height}; }

// Without a rig, a usual focal length is assumed. The pattern fits as well, but its angles mean nothing.
PosePattern pattern_of(const Rig* rig, Size frame, double right_shift) {
  if (rig == nullptr) return {1.0 * frame.width, 1.0 * frame.width, 0.5 * (frame.width - 1), 0.5 * (frame.height - 1), 0.0, false};
  const RectifiedGeometry& g = rig->geometry();
  return {g.focal_px(), g.focal_y_px(), g.cx(), g.cy(), g.doffs() - right_shift, true};
}

// What is read of each frame alone. Most of the time is spent waiting for memory, so both are read at once.
void read_each(const FramePair& pair, FrameReport& report) {
  const std::array frames = {&pair.left, &pair.right};
  std::array<double, frames.size()> combed{};
  parallel_for(static_cast<int>(frames.size()), 1, [&](int begin, int end, int) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      combed[i] = combed_share(*frames[i]);
      report.prints[i] = print_of(*frames[i]);
    }
  });
  report.causes.set(Cause::interlaced, std::fmax(combed[0], combed[1]));
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
  read_each(pair, report);
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
  const PosePattern pattern = pattern_of(rig, stage_->frame(), stage_->right_shift());
  const int valid = postprocess(maps, limits, rig, pattern);
  report.valid_share = valid / static_cast<double>(count_of(stage_->frame()));
  const Clock::time_point filled = Clock::now();
  judgement_.judge({scratch_, *stage_, rig, pattern, rest_apart_, maps.reasons}, report);
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

int Slot::postprocess(const MapsOut& maps, const Limits& limits, const Rig* rig, const PosePattern& pattern) {
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
  in.pattern = pattern;
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
