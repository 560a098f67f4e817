#include "frame_path/slot.hpp"

namespace endosdk {
namespace {

size_t pixels(Size size) { return static_cast<size_t>(size.width) * static_cast<size_t>(size.height); }

FloatView read_only(const MutableFloatView& view) { return {view.data, view.width, view.height}; }

}  // namespace

Slot::Slot(std::shared_ptr<const RectifyStage> stage, std::shared_ptr<Session> session)
    : stage_(std::move(stage)),
      session_(std::move(session)),
      model_(session_->model()),
      buffers_(stage_->picture(), model_),
      run_(session_->bind(buffers_)),
      spare_(pixels(stage_->frame())) {}

void Slot::rectify(const FramePair& pair, FrameReport& report) {
  const std::lock_guard lock(pictures_);
  const Clock::time_point started = Clock::now();
  (*stage_)(pair.left, pair.right, buffers_.left(), buffers_.right(), pair.order, rectify_scratch_);
  same_frames_ = same_pixels(pair.left, pair.right);
  report.rectify_ms += milliseconds(started, Clock::now());
}

void Slot::answer(const MapsOut& wanted, const Limits& limits, const Rig* rig, Work& work, FrameReport& report) {
  const Clock::time_point rectified = Clock::now();
  work.run(*run_);
  const Clock::time_point inferred = Clock::now();
  const int valid = postprocess(spare_.complete(wanted), limits, rig);
  work.check();
  report.session_ms = milliseconds(rectified, inferred);
  report.postprocess_ms = milliseconds(inferred, Clock::now());
  report.valid_share = valid / static_cast<double>(pixels(stage_->frame()));
  report.quality = quality_of(report.valid_share);
  report.views_belong_together = scratch_.consistency.views_belong_together();
}

int Slot::postprocess(const MapsOut& maps, const Limits& limits, const Rig* rig) {
  const Size frame = stage_->frame();
  const Size picture = stage_->picture();
  PostprocessInput in;
  in.disparity = read_only(buffers_.disparity());
  in.confidence = read_only(buffers_.confidence());
  // Relative to the picture without its padding, which the grids include.
  in.view_scale = {static_cast<double>(picture.height) / frame.height, static_cast<double>(picture.width) / frame.width};
  in.scale = {in.view_scale.y / model_.output_stride, in.view_scale.x / model_.output_stride};
  in.gain = static_cast<float>(static_cast<double>(frame.width) / picture.width);
  in.min_confidence = static_cast<float>(limits.min_confidence);
  in.max_candidate_disparity = model_.max_candidate_disparity;
  in.upsampling = model_.upsampling;
  in.left = buffers_.left();
  in.right = buffers_.right();
  in.same_frames = same_frames_;
  in.right_shift = stage_->right_shift();
  in.valid_left = stage_->valid_left();
  in.valid_right = stage_->valid_right();
  if (rig != nullptr) {
    const RectifiedGeometry& g = rig->geometry();
    in.geometry = {g.focal_px(), g.baseline_mm(), g.doffs(), limits.min_depth_mm, limits.max_depth_mm};
  }
  PostprocessOutput out;
  out.disparity = {maps.disparity, frame.width, frame.height};
  out.confidence = {maps.confidence, frame.width, frame.height};
  out.reasons = maps.reasons;
  out.depth = maps.depth;
  out.sigma = maps.sigma;
  const int valid = endosdk::postprocess(in, out, scratch_);
  write_u16(maps, pixels(frame), limits.depth_unit_mm);
  return valid;
}

void Slot::copy_pictures(uint8_t* left, uint8_t* right) {
  const std::lock_guard lock(pictures_);
  copy_interleaved(buffers_.left(), stage_->picture(), left);
  copy_interleaved(buffers_.right(), stage_->picture(), right);
}

}  // namespace endosdk
