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

// The part of the views that is no padding.
Size picture_of(const PostprocessInput& in) {
  const auto length = [](int size, double scale) { return static_cast<int>(std::ceil(size * scale - 1e-6)); };
  return {length(in.size.width, in.view_scale.x), length(in.size.height, in.view_scale.y)};
}

void check(const PostprocessInput& in, const MapsOut& out) {
  check_grid(in.disparity, "disparity");
  check_grid(in.confidence, "confidence");
  require(in.disparity.width == in.confidence.width && in.disparity.height == in.confidence.height, "confidence",
          "must have the size of disparity",
          Text(in.confidence.width, "x", in.confidence.height));
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
    const bool alike = in.left.data != nullptr && in.right.width == in.left.width && in.right.height == in.left.height;
    require(alike, "right_image", "must have the shape of image", Text(in.right.width, "x", in.right.height));
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
  // Infinity lies at disparity -doffs, but the network finds nothing below 0.
  const double infinity = limits.metric ? std::max(0.0, in.right_shift - g.doffs) : 0.0;
  limits.disparity_begin = static_cast<float>(range_margin * static_cast<double>(in.gain) + infinity);
  if (limits.metric) {
    limits.focal_baseline = static_cast<float>(g.focal_px * g.baseline_mm);
    limits.doffs = static_cast<float>(g.doffs - in.right_shift);
    limits.min_depth = static_cast<float>(g.min_depth_mm);
    limits.max_depth = static_cast<float>(g.max_depth_mm);
    // Scale of the Laplace law, gain / -log(1 - own confidence) in frame pixels, which is its mean error. Its standard deviation
    // would be sqrt(2) times that: too much for real errors, which the law's tails overstate.
    limits.sigma_factor = static_cast<float>(static_cast<double>(in.gain) / (g.focal_px * g.baseline_mm));
  }
  return limits;
}

DepthRow row_of(const PostprocessInput& in, const MapsOut& out, int y) {
  const int64_t offset = static_cast<int64_t>(y) * in.size.width;
  DepthRow row{};
  row.disparity = out.disparity + offset;
  row.confidence = out.confidence + offset;
  row.reasons = out.reasons + offset;
  row.width = in.size.width;
  if (in.valid_left != nullptr) row.valid_left = in.valid_left + offset;
  if (in.valid_right != nullptr) row.valid_right = in.valid_right + offset;
  if (out.depth != nullptr) row.depth = out.depth + offset;
  if (out.sigma != nullptr) row.sigma = out.sigma + offset;
  return row;
}

}  // namespace

int postprocess(const PostprocessInput& input, const MapsOut& maps, PostprocessScratch& scratch) {
  check(input, maps);
  const bool has_view = input.left.data != nullptr;
  FloatView disparity = input.disparity;
  Scale disparity_scale = input.scale;
  if (has_view && JointBilateralUpsampling::factor(input.disparity, input.left) > 0) {
    disparity = scratch.upsampling.upsampled(input.disparity, input.confidence, input.left, input.upsampling);
    disparity_scale = input.view_scale;
  }
  const int width = input.size.width;
  RowResizer& disparities = scratch.disparity;
  RowResizer& confidences = scratch.confidence;
  disparities.prepare(disparity.width, disparity.height, width, disparity_scale);
  confidences.prepare(input.confidence.width, input.confidence.height, width, input.scale);
  const int workers = disparities.workers();
  // Whether this frame has a sigma or not: a later one takes no memory for it.
  RowResizer& own_confidences = scratch.own;
  own_confidences.prepare(input.confidence.width, input.confidence.height, width, input.scale);
  scratch.own_row.resize(static_cast<size_t>(workers) * static_cast<size_t>(width));
  GlareRows& views = scratch.glare;
  if (has_view) views.prepare(input.left, width, input.view_scale, workers);
  const auto started = std::chrono::steady_clock::now();
  const bool has_right = input.right.data != nullptr;
  const Scale cells = has_right ? Scale{input.scale.y / input.view_scale.y, input.scale.x / input.view_scale.x} : Scale{};
  if (has_right) {
    scratch.views.compare(input.disparity, input.left, input.right, picture_of(input), cells, input.fields);
    scratch.measures.measure(scratch.views, picture_of(input).width);
    if (input.pattern.focal_x > 0.0) {
      scratch.rows.measure(scratch.views, input.confidence, cells, {1.0 / input.view_scale.y, 1.0 / input.view_scale.x}, input.pattern);
    }
  }
  scratch.consistency.judge(input.confidence, input.reach, has_right ? &scratch.views : nullptr, cells);
  FieldRows& fields = scratch.fields;
  const bool has_fields = has_right && scratch.views.size().width > 0;
  if (has_fields) {
    const double cell = 2.0 * scratch.views.unit();
    fields.prepare(scratch.views.field(0), scratch.views.field(1), width, {input.view_scale.y / cell, input.view_scale.x / cell}, workers);
  }
  scratch.trust_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started).count();
  const DepthLimits limits = limits_of(input);
  const RigSigma rig_sigma(has_right ? scratch.rows.latest() : PoseError(), input.pattern,
                           static_cast<double>(limits.focal_baseline));
  const float shift = static_cast<float>(input.right_shift);
  std::atomic<int> usable{0};
  const auto process_rows = [&](int begin, int end, int worker) {
    int count = 0;
    for (int y = begin; y < end; ++y) {
      DepthRow row = row_of(input, maps, y);
      if (has_view) row.brightness = views.row(input.left, y, worker);
      if (has_fields) {
        row.inside_left = fields.left(y, worker);
        row.valid_right = fields.right(y, worker, row.valid_right);
      }
      float* const disparity_row = maps.disparity + static_cast<int64_t>(y) * width;
      disparities.row(disparity, y, input.gain, worker, disparity_row);
      confidences.row(scratch.consistency.seen(), y, 1.0f, worker, maps.confidence + static_cast<int64_t>(y) * width);
      if (row.sigma != nullptr) {
        float* const own = scratch.own_row.data() + static_cast<ptrdiff_t>(worker) * width;
        own_confidences.row(scratch.consistency.own(), y, 1.0f, worker, own);
        row.own_confidence = own;
      }
      count += kernels().depth_row(row, limits);
      if (row.sigma != nullptr) rig_sigma.add(row.depth, y, width, row.sigma);
      if (shift != 0.0f) {
        for (int x = 0; x < width; ++x) disparity_row[x] -= shift;
      }
    }
    usable += count;
  };
  parallel_for(input.size.height, rows_per_block, process_rows, workers);
  return usable;
}

}  // namespace endosdk
