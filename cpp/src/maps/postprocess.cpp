#include "maps/postprocess.hpp"

#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>

#include "platform/errors.hpp"
#include "kernels/kernels.hpp"
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
Size picture_of(const PostprocessInput& in, const PostprocessOutput& out) {
  const auto length = [](int size, double scale) { return static_cast<int>(std::ceil(size * scale - 1e-6)); };
  return {length(out.disparity.width, in.view_scale.x), length(out.disparity.height, in.view_scale.y)};
}

void check(const PostprocessInput& in, const PostprocessOutput& out) {
  check_grid(in.disparity, "disparity");
  check_grid(in.confidence, "confidence");
  require(in.disparity.width == in.confidence.width && in.disparity.height == in.confidence.height, "confidence",
          "must have the size of disparity",
          Text(in.confidence.width, "x", in.confidence.height));
  check_scale(in.scale, in.gain);
  check_grid({out.disparity.data, out.disparity.width, out.disparity.height}, "out_disparity");
  require(std::isfinite(in.min_confidence), "min_confidence", "must be finite", in.min_confidence);
  require(std::isfinite(in.max_candidate_disparity) && in.max_candidate_disparity >= 0.0, "max_candidate_disparity", "must be finite and not negative",
          in.max_candidate_disparity);
  check_scale(in.view_scale, in.gain);
  require(std::isfinite(in.right_shift), "right_shift", "must be finite", in.right_shift);
  const Size picture = picture_of(in, out);
  if (in.left.data != nullptr) check_planar(in.left, picture.width, picture.height, "image");
  if (in.right.data != nullptr) {
    const bool alike = in.left.data != nullptr && in.right.width == in.left.width && in.right.height == in.left.height;
    require(alike, "right_image", "must have the shape of image", Text(in.right.width, "x", in.right.height));
  }
  check_geometry(in.geometry, out.depth != nullptr || out.sigma != nullptr);
}

DepthLimits limits_of(const PostprocessInput& in) {
  const DepthGeometry& g = in.geometry;
  DepthLimits limits{};
  limits.min_confidence = in.min_confidence;
  limits.disparity_end = in.max_candidate_disparity > 0.0
                             ? static_cast<float>((in.max_candidate_disparity - range_margin) * static_cast<double>(in.gain))
                             : std::numeric_limits<float>::infinity();
  limits.metric = g.focal_px > 0.0;
  if (limits.metric) {
    limits.focal_baseline = static_cast<float>(g.focal_px * g.baseline_mm);
    limits.doffs = static_cast<float>(g.doffs - in.right_shift);
    limits.min_depth = static_cast<float>(g.min_depth_mm);
    limits.max_depth = static_cast<float>(g.max_depth_mm);
    // A Laplace law of scale b has standard deviation sqrt(2) b; b = gain / -log(1 - confidence) in frame pixels.
    limits.sigma_factor = static_cast<float>(std::sqrt(2.0) * static_cast<double>(in.gain) / (g.focal_px * g.baseline_mm));
  }
  return limits;
}

DepthRow row_of(const PostprocessInput& in, const PostprocessOutput& out, int y,
                const uint8_t* brightness) {
  const int64_t offset = static_cast<int64_t>(y) * out.disparity.width;
  DepthRow row{};
  row.disparity = out.disparity.row(y);
  row.confidence = out.confidence.row(y);
  row.reasons = out.reasons + offset;
  row.width = out.disparity.width;
  row.brightness = brightness;
  if (in.valid_left != nullptr) row.valid_left = in.valid_left + offset;
  if (in.valid_right != nullptr) row.valid_right = in.valid_right + offset;
  if (out.depth != nullptr) row.depth = out.depth + offset;
  if (out.sigma != nullptr) row.sigma = out.sigma + offset;
  return row;
}

}  // namespace

int postprocess(const PostprocessInput& input, const PostprocessOutput& output) {
  thread_local PostprocessScratch scratch;
  return postprocess(input, output, scratch);
}

int postprocess(const PostprocessInput& input, const PostprocessOutput& output, PostprocessScratch& scratch) {
  check(input, output);
  const bool has_view = input.left.data != nullptr;
  FloatView disparity = input.disparity;
  Scale disparity_scale = input.scale;
  if (has_view && JointBilateralUpsampling::factor(input.disparity, input.left) > 0) {
    disparity = scratch.upsampling.upsampled(input.disparity, input.confidence, input.left, input.upsampling);
    disparity_scale = input.view_scale;
  }
  const int width = output.disparity.width;
  RowResizer& disparities = scratch.disparity;
  RowResizer& confidences = scratch.confidence;
  disparities.prepare(disparity.width, disparity.height, width, disparity_scale);
  confidences.prepare(input.confidence.width, input.confidence.height, width, input.scale);
  const int workers = disparities.workers();
  GlareRows& views = scratch.glare;
  if (has_view) views.prepare(input.left, width, input.view_scale, workers);
  FloatView confidence = input.confidence;
  if (input.right.data != nullptr) {
    const Scale cells = {input.scale.y / input.view_scale.y, input.scale.x / input.view_scale.x};
    confidence = scratch.consistency.supported(input.disparity, confidence, input.left, input.right,
                                             picture_of(input, output), cells, input.same_frames);
  }
  const DepthLimits limits = limits_of(input);
  const float shift = static_cast<float>(input.right_shift);
  std::atomic<int> usable{0};
  const auto process_rows = [&](int begin, int end, int worker) {
    int count = 0;
    for (int y = begin; y < end; ++y) {
      disparities.row(disparity, y, input.gain, worker, output.disparity.row(y));
      confidences.row(confidence, y, 1.0f, worker, output.confidence.row(y));
      const uint8_t* brightness = has_view ? views.row(input.left, y, worker) : nullptr;
      count += kernels().depth_row(row_of(input, output, y, brightness), limits);
      if (shift != 0.0f) {
        for (int x = 0; x < width; ++x) output.disparity.row(y)[x] -= shift;
      }
    }
    usable += count;
  };
  parallel_for(output.disparity.height, rows_per_block, process_rows, workers);
  return usable;
}

}  // namespace endosdk
