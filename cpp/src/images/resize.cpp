#include "images/resize.hpp"

#include <algorithm>
#include <cmath>

#include "images/size.hpp"
#include "platform/errors.hpp"
#include "kernels/kernels.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 16;

// The source index before an output position, and the weight of the next one. Both are computed in single precision with one
// rounding, as in torch.
struct Position {
  int index;
  float weight;
};

Position position(int out, float scale, int size) {
  const float source = std::max(std::fmaf(static_cast<float>(out) + 0.5f, scale, -0.5f), 0.0f);
  if (source >= static_cast<float>(size - 1)) return {size - 1, 0.0f};
  const int index = static_cast<int>(source);
  return {index, source - static_cast<float>(index)};
}

}  // namespace

void check_grid(const FloatView& source, const char* name) {
  require(source.width >= 1 && source.height >= 1, name, "must not be empty", Size{source.width, source.height});
}

void check_scale(Scale scale, float gain) {
  require(std::isfinite(scale.y) && scale.y > 0.0, "scale_y", "must be positive and finite", scale.y);
  require(std::isfinite(scale.x) && scale.x > 0.0, "scale_x", "must be positive and finite", scale.x);
  require(std::isfinite(gain) && gain > 0.0f, "gain", "must be positive and finite", gain);
}

void RowResizer::prepare(int source_width, int source_height, int out_width, Scale scale) {
  source_width_ = source_width;
  source_height_ = source_height;
  out_width_ = out_width;
  scale_y_ = static_cast<float>(scale.y);
  index_.resize(out_width);
  weight_.resize(out_width);
  for (int x = 0; x < out_width; ++x) {
    const Position p = position(x, static_cast<float>(scale.x), source_width);
    index_[x] = p.index;
    weight_[x] = p.weight;
  }
  workers_ = thread_count();
  stride_ = source_width + stretch_reach;
  scratch_.resize(static_cast<size_t>(2 * stride_) * workers_);
}

void RowResizer::row(const FloatView& source, int y, float gain, int worker, float* out) {
  const Position p = position(y, scale_y_, source_height_);
  const float* upper = source.data + static_cast<int64_t>(p.index) * source_width_;
  const float* lower = p.index + 1 < source_height_ ? upper + source_width_ : upper;
  float* value = scratch_.data() + static_cast<int64_t>(worker) * 2 * stride_;
  float* step = value + stride_;
  kernels().blend_rows(upper, lower, p.weight, gain, source_width_, value, step);
  kernels().stretch_row(value, step, index_.data(), weight_.data(), out_width_, out);
}

void resize_bilinear(const FloatView& source, const MutableFloatView& out, Scale scale, float gain) {
  check_grid(source, "src");
  check_grid({out.data, out.width, out.height}, "out");
  check_scale(scale, gain);
  RowResizer resizer;
  resizer.prepare(source.width, source.height, out.width, scale);
  const auto resize_rows = [&](int begin, int end, int worker) {
    for (int y = begin; y < end; ++y) resizer.row(source, y, gain, worker, out.row(y));
  };
  parallel_for(out.height, rows_per_block, resize_rows, resizer.workers());
}

}  // namespace endosdk
