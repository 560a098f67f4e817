#include "frame_path/simultaneity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace endosdk {
namespace {

constexpr double fading = 1.0 - 1.0 / 90.0;  // per frame
constexpr int least_frames = 8;

// The errors of neighbouring frames are alike, so this many frames tell as much as one independent frame.
constexpr double alike_frames = 4.0;

constexpr double certain = 4.0;      // standard errors
constexpr double least_lag = 0.2;    // frames; a smaller lag does not come from unsynchronised cameras
constexpr double least_row_se = 0.05;  // px: least standard error that is assumed for the rows of a frame

constexpr double view_share = 0.02;  // of the width by which a picture moves until it is another view

// Finest level of the pyramid that is used; the shift of the whole picture needs no finer one.
constexpr int finest = 1;

double certain_motion_px(const LagFit& fit, double lag) {
  return lag > certain * fit.lag_se() && lag > least_lag ? lag * fit.usual_motion_px() : 0.0;
}


}  // namespace

void LagFit::add(double moved_px, double rows_px) {
  for (double* sum : {&sum_, &x_, &y_, &xx_, &xy_, &yy_}) *sum *= fading;
  sum_ += 1.0;
  x_ += moved_px;
  y_ += rows_px;
  xx_ += moved_px * moved_px;
  xy_ += moved_px * rows_px;
  yy_ += rows_px * rows_px;
  ++frames_;
}

double LagFit::lag() const {
  const double spread = xx_ - x_ * x_ / sum_;
  return spread > 0.0 ? (xy_ - x_ * y_ / sum_) / spread : 0.0;
}

double LagFit::lag_se() const {
  const double spread = xx_ - x_ * x_ / sum_;
  if (!(spread > 0.0) || sum_ <= 2.0) return std::numeric_limits<double>::infinity();
  const double left = std::max(0.0, yy_ - y_ * y_ / sum_ - lag() * (xy_ - x_ * y_ / sum_)) / (sum_ - 2.0);
  return std::sqrt(alike_frames * (left + least_row_se * least_row_se) / spread);
}

double LagFit::usual_motion_px() const { return sum_ > 0.0 ? std::sqrt(xx_ / sum_) : 0.0; }

void Simultaneity::make_room(const BrightnessPyramid& view) {
  former_ = view;
  has_former_ = false;
  former_rows_px_.reset();
  if (view.levels() <= finest) return;
  motion_.find(view, former_, finest);
  motion_.middle();
  motion_.outwards();
}

void Simultaneity::travel(const ImageMotion::Shift& shift, float outwards, int width) {
  const std::array<float, 3> moved = {shift.x, shift.y, outwards};
  double square = 0.0;
  for (size_t i = 0; i < moved.size(); ++i) {
    travelled_[i] += static_cast<double>(moved[i]) / width;
    square += travelled_[i] * travelled_[i];
  }
  new_view_ = square >= view_share * view_share;
  if (new_view_) travelled_ = {};
}

std::optional<double> Simultaneity::motion_between(BrightnessPyramid& view, double row_px, const PoseError& pose) {
  const bool follows = has_former_ && view.levels() > finest && view.unit() == former_.unit() &&
                       view.levels() == former_.levels() && view.level(0).size == former_.level(0).size;
  new_view_ = !follows;
  if (follows && (pose.measured || former_rows_px_)) {
    motion_.find(view, former_, finest);
    const ImageMotion::Shift shift = motion_.middle();
    const double moved_px = view.unit() * (1 << finest) * row_px * static_cast<double>(shift.y);
    travel(shift, motion_.outwards(), view.level(finest).size.width);
    if (pose.measured) right_.add(moved_px, pose.mean_vertical_px);
    if (former_rows_px_) left_.add(moved_px, *former_rows_px_);
  }
  std::swap(view, former_);
  has_former_ = true;
  former_rows_px_ = pose.measured ? std::optional(pose.mean_vertical_px) : std::nullopt;
  if (std::min(right_.frames(), left_.frames()) < least_frames) return std::nullopt;
  return std::max(certain_motion_px(right_, right_.lag()), certain_motion_px(left_, -left_.lag()));
}

}  // namespace endosdk
