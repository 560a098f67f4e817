#include "maps/postprocess.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>

#include "platform/errors.hpp"
#include "kernels/kernels.hpp"
#include "maps/repeated_pattern.hpp"
#include "maps/rig_sigma.hpp"
#include "images/size.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 16;

void check_geometry(const DepthGeometry& g, bool wanted) {
  require(std::isfinite(g.focal_px) && g.focal_px >= 0.0, "focal_px", "must be finite and not negative", g.focal_px);
  if (g.focal_px == 0.0) {
    require(!wanted, "focal_px", "must be positive for depth or sigma", g.focal_px);
    return;
  }
  require(std::isfinite(g.baseline_mm) && g.baseline_mm > 0.0, "baseline_mm", "must be positive and finite",
          g.baseline_mm);
  require(std::isfinite(g.doffs), "doffs", "must be finite", g.doffs);
  require(std::isfinite(g.min_depth_mm) && g.min_depth_mm >= 0.0, "min_depth_mm", "must be finite and not negative",
          g.min_depth_mm);
  require(g.max_depth_mm > g.min_depth_mm, "max_depth_mm", "must be greater than min_depth_mm", g.max_depth_mm);
}

// The part of the views without the padding.
Size picture_of(const PostprocessInput& in) {
  const auto length = [](int size, double scale) { return static_cast<int>(std::ceil(size * scale - 1e-6)); };
  return {length(in.size.width, in.view_scale.x), length(in.size.height, in.view_scale.y)};
}

void check(const PostprocessInput& in, const MapsOut& out) {
  check_grid(in.disparity, "disparity");
  check_grid(in.confidence, "confidence");
  require(in.disparity.width == in.confidence.width && in.disparity.height == in.confidence.height, "confidence",
          "must have the size of disparity",
          Size{in.confidence.width, in.confidence.height});
  check_scale(in.scale, in.gain);
  check_grid({out.disparity, in.size.width, in.size.height}, "out_disparity");
  require(std::isfinite(in.min_confidence), "min_confidence", "must be finite", in.min_confidence);
  require(std::isfinite(in.max_candidate_disparity) && in.max_candidate_disparity >= 0.0, "max_candidate_disparity", "must be finite and not negative",
          in.max_candidate_disparity);
  check_scale(in.view_scale, in.gain);
  require(std::isfinite(in.reach) && in.reach > 0.0, "reach", "must be positive and finite", in.reach);
  require(std::isfinite(in.right_shift), "right_shift", "must be finite", in.right_shift);
  const Size picture = picture_of(in);
  if (in.left.data != nullptr) check_planar(in.left, picture.width, picture.height, "image");
  if (in.right.data != nullptr) {
    const bool alike = in.left.data != nullptr && in.right.size() == in.left.size();
    require(alike, "right_image", "must have the shape of image", in.right.size());
  }
  check_geometry(in.geometry, out.depth != nullptr || out.sigma != nullptr);
  require(out.sigma == nullptr || out.depth != nullptr, "depth", "must be there where sigma is wanted", "none");
}

DepthLimits limits_of(const PostprocessInput& in) {
  const DepthGeometry& g = in.geometry;
  DepthLimits limits{};
  limits.min_confidence = in.min_confidence;
  limits.disparity_end = in.max_candidate_disparity > 0.0
                             ? static_cast<float>((in.max_candidate_disparity - range_margin) * static_cast<double>(in.gain))
                             : std::numeric_limits<float>::infinity();
  limits.metric = g.focal_px > 0.0;
  // Infinite depth has the disparity -doffs, but the network finds nothing below 0.
  const double infinity = limits.metric ? std::max(0.0, in.right_shift - g.doffs) : 0.0;
  limits.disparity_begin = static_cast<float>(range_margin * static_cast<double>(in.gain) + infinity);
  if (limits.metric) {
    limits.focal_baseline = static_cast<float>(g.focal_px * g.baseline_mm);
    limits.doffs = static_cast<float>(g.doffs - in.right_shift);
    limits.min_depth = static_cast<float>(g.min_depth_mm);
    limits.max_depth = static_cast<float>(g.max_depth_mm);
    // Sigma uses the scale of the Laplace law, gain / -log(1 - own confidence) in frame pixels, which is its mean error. The
    // standard deviation is sqrt(2) times larger. That is too much for real errors, because the law's tails overstate them.
    limits.sigma_factor = static_cast<float>(static_cast<double>(in.gain) / (g.focal_px * g.baseline_mm));
  }
  return limits;
}

using Clock = std::chrono::steady_clock;
using Milliseconds = std::chrono::duration<double, std::milli>;

bool has_left(const PostprocessInput& in) { return in.left.data != nullptr; }
bool has_right(const PostprocessInput& in) { return in.right.data != nullptr; }

// Cells of the disparity per pixel of the views.
Scale cells_of(const PostprocessInput& in) { return {in.scale.y / in.view_scale.y, in.scale.x / in.view_scale.x}; }

// Compares the views where the network matched them, and lowers the confidence where they contradict it.
void judge_views(const PostprocessInput& in, PostprocessScratch& scratch) {
  if (has_right(in)) {
    scratch.views.compare(in.disparity, in.left, in.right, picture_of(in), cells_of(in), in.fields);
    scratch.overlays.clear();
    if (in.equal != nullptr) scratch.overlays.find(*in.equal, *in.blocks, scratch.views);
    scratch.measures.measure(scratch.views, picture_of(in).width);
    scratch.search.take(scratch.views);
    scratch.rivals = share_of_rivals(scratch.search, scratch.views);
    scratch.rows.measure(scratch.views, in.confidence, cells_of(in), {1.0 / in.view_scale.y, 1.0 / in.view_scale.x}, in.pattern);
  }
  scratch.consistency.judge(in.confidence, in.reach, has_right(in) ? &scratch.views : nullptr, has_right(in) ? cells_of(in) : Scale{},
                            has_right(in) ? &scratch.rows.misfit() : nullptr);
}

// A disparity map, and its pixels per output pixel.
struct Scaled {
  FloatView map;
  Scale scale;
};

// Judges the views. Meanwhile, other threads upsample the disparity to the grid of the left view, if this view can guide it.
Scaled judge_and_upsample(const PostprocessInput& in, PostprocessScratch& scratch) {
  JointBilateralUpsampling& upsampling = scratch.upsampling;
  const auto since = [](Clock::time_point begin) { return Milliseconds(Clock::now() - begin).count(); };
  if (!has_left(in) || JointBilateralUpsampling::factor(in.disparity, in.left) == 0) {
    const Clock::time_point started = Clock::now();
    judge_views(in, scratch);
    scratch.trust_ms = since(started);
    return {in.disparity, in.scale};
  }
  upsampling.read(in.disparity, in.confidence, in.left, in.upsampling);
  std::atomic<double> upsampling_ms = 0.0;  // of all threads together
  const auto write_rows = [&](int begin, int end, int) {
    const Clock::time_point started = Clock::now();
    for (int y = begin; y < end; ++y) upsampling.write_row(y);
    upsampling_ms += since(started);
  };
  const Clock::time_point started = Clock::now();
  // The judgement has many short loops, which more threads speed up little. So it takes one thread, and the others upsample.
  parallel_for_beside([&] { judge_views(in, scratch); }, in.left.height, JointBilateralUpsampling::rows_per_block, write_rows);
  // The judgement costs the frame what the threads would not have needed for the upsampling alone.
  scratch.trust_ms = std::max(0.0, since(started) - upsampling_ms / thread_count());
  return {upsampling.map(), in.view_scale};
}

// Writes rows of the maps, on several threads.
class RowWriter {
 public:
  RowWriter(const PostprocessInput& in, const MapsOut& maps, const Scaled& disparity, PostprocessScratch& scratch)
      : in_(in), maps_(maps), disparity_(disparity.map), scratch_(scratch), limits_(limits_of(in)),
        rig_sigma_(has_right(in) ? scratch.rows.latest() : PoseError(), in.pattern, static_cast<double>(limits_.focal_baseline)),
        shift_(static_cast<float>(in.right_shift)) {
    const int width = in.size.width;
    scratch.disparity.prepare(disparity.map.width, disparity.map.height, width, disparity.scale);
    scratch.confidence.prepare(in.confidence.width, in.confidence.height, width, in.scale);
    // Prepared even if this frame has no sigma, so that a later frame with sigma allocates nothing.
    scratch.own.prepare(in.confidence.width, in.confidence.height, width, in.scale);
    scratch.own_row.resize(static_cast<size_t>(workers()) * static_cast<size_t>(width));
    if (has_left(in)) scratch.glare.prepare(in.left, width, in.view_scale, workers());
    has_fields_ = has_right(in) && scratch.views.size().width > 0;
    if (has_fields_) {
      const double cell = 2.0 * scratch.views.unit();
      scratch.fields.prepare(scratch.views, scratch.overlays, width, {in.view_scale.y / cell, in.view_scale.x / cell}, workers());
    }
  }

  int workers() const { return scratch_.disparity.workers(); }

  // Writes row y and returns how many of its pixels have no reason.
  int write(int y, int worker) const {
    DepthRow row = row_of(y);
    if (has_left(in_)) row.brightness = scratch_.glare.row(in_.left, y, worker);
    if (has_fields_) {
      row.inside_left = scratch_.fields.left(y, worker);
      row.valid_right = scratch_.fields.right(y, worker, row.valid_right);
    }
    float* const disparity = maps_.disparity + first_of(y);
    scratch_.disparity.row(disparity_, y, in_.gain, worker, disparity);
    scratch_.confidence.row(scratch_.consistency.seen(), y, 1.0f, worker, maps_.confidence + first_of(y));
    if (row.sigma != nullptr) {
      float* const own = scratch_.own_row.data() + static_cast<ptrdiff_t>(worker) * row.width;
      scratch_.own.row(scratch_.consistency.own(), y, 1.0f, worker, own);
      row.own_confidence = own;
    }
    const int usable = kernels().depth_row(row, limits_);
    if (row.sigma != nullptr) rig_sigma_.add(row.depth, y, row.width, row.sigma);
    if (shift_ != 0.0f) {
      for (int x = 0; x < row.width; ++x) disparity[x] -= shift_;
    }
    return usable;
  }

 private:
  // The first pixel of a row.
  int64_t first_of(int y) const { return static_cast<int64_t>(y) * in_.size.width; }

  DepthRow row_of(int y) const {
    const int64_t offset = first_of(y);
    DepthRow row{};
    row.disparity = maps_.disparity + offset;
    row.confidence = maps_.confidence + offset;
    row.reasons = maps_.reasons + offset;
    row.width = in_.size.width;
    if (in_.valid_left != nullptr) row.valid_left = in_.valid_left + offset;
    if (in_.valid_right != nullptr) row.valid_right = in_.valid_right + offset;
    if (maps_.depth != nullptr) row.depth = maps_.depth + offset;
    if (maps_.sigma != nullptr) row.sigma = maps_.sigma + offset;
    return row;
  }

  const PostprocessInput& in_;
  const MapsOut& maps_;
  FloatView disparity_;
  PostprocessScratch& scratch_;
  DepthLimits limits_;
  RigSigma rig_sigma_;
  float shift_;
  bool has_fields_ = false;
};

}  // namespace

int postprocess(const PostprocessInput& input, const MapsOut& maps, PostprocessScratch& scratch) {
  check(input, maps);
  const Scaled disparity = judge_and_upsample(input, scratch);
  const RowWriter writer(input, maps, disparity, scratch);
  std::atomic<int> usable{0};
  const auto write_rows = [&](int begin, int end, int worker) {
    int count = 0;
    for (int y = begin; y < end; ++y) count += writer.write(y, worker);
    usable += count;
  };
  parallel_for(input.size.height, rows_per_block, write_rows, writer.workers());
  return usable;
}

}  // namespace endosdk
