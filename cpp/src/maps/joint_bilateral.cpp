#include "maps/joint_bilateral.hpp"

#include <algorithm>
#include <cmath>

#include "platform/threads.hpp"

namespace endosdk {
namespace {

static_assert(joint_bilateral_taps == 2 * upsampling_reach);

constexpr int most_pixels_per_cell = 16;
constexpr int channels = 3;

// Where a pixel lies relative to the centre of its cell, in cells.
double offset(int phase, int factor) { return (phase + 0.5) / factor - 0.5; }

// The first of the cells around a pixel, relative to its own.
int first_cell(int phase, int factor) {
  return static_cast<int>(std::floor(offset(phase, factor))) - (JointBilateralUpsampling::reach - 1);
}

// Weight of the tap-th of the cells around a pixel.
double tent(int phase, int factor, int tap) {
  const double distance = std::abs(offset(phase, factor) - (first_cell(phase, factor) + tap));
  return std::max(0.0, 1.0 - distance / JointBilateralUpsampling::reach);
}

}  // namespace

int JointBilateralUpsampling::factor(const FloatView& cells, const PlanarView& view) {
  const int factor = view.width / cells.width;
  const bool whole = view.width == factor * cells.width && view.height == factor * cells.height;
  return whole && factor > 1 && factor <= most_pixels_per_cell ? factor : 0;
}

void JointBilateralUpsampling::prepare(const FloatView& cells, int factor) {
  if (factor != factor_) {
    factor_ = 0;  // in case memory runs out before the tables are complete
    start_.clear();
    share_.clear();
    // The stored cells begin `reach` cells left of the grid.
    for (int phase = 0; phase < factor; ++phase) start_.push_back(first_cell(phase, factor) + reach);
    for (int row = 0; row < factor; ++row) {
      for (int column = 0; column < factor; ++column) {
        for (int down = 0; down < joint_bilateral_taps; ++down) {
          for (int along = 0; along < joint_bilateral_taps; ++along) {
            share_.push_back(static_cast<float>(tent(row, factor, down) * tent(column, factor, along)));
          }
        }
      }
    }
    factor_ = factor;
  }
  width_ = cells.width;
  height_ = cells.height;
  stride_ = width_ + 2 * reach;
  const size_t grid = static_cast<size_t>(stride_) * static_cast<size_t>(height_);
  planes_.resize(joint_bilateral_planes * grid);
  out_.resize(static_cast<size_t>(width_) * static_cast<size_t>(height_) * static_cast<size_t>(factor) *
              static_cast<size_t>(factor));
}

float* JointBilateralUpsampling::plane(int index, int y) {
  return planes_.data() + (static_cast<ptrdiff_t>(index) * height_ + y) * stride_;
}

void JointBilateralUpsampling::read_cells(const FloatView& disparity, const FloatView& confidence, int y) {
  for (int c = 0; c < channels; ++c) {
    kernels().mean_cells(view_.row(c, y * factor_), view_.width, factor_, width_, plane(c, y) + reach);
  }
  const ptrdiff_t first = static_cast<ptrdiff_t>(y) * width_;
  kernels().trust_cells(disparity.data + first, confidence.data + first, width_, plane(channels, y) + reach,
                        plane(channels + 1, y) + reach);
  for (int index = 0; index < joint_bilateral_planes; ++index) {
    float* const cells = plane(index, y);
    std::fill_n(cells, reach, cells[reach]);
    std::fill_n(cells + reach + width_, reach, cells[reach + width_ - 1]);
  }
}

void JointBilateralUpsampling::write_row(int y) {
  const int phase = y % factor_;
  JointBilateralRow row{};
  for (int c = 0; c < channels; ++c) row.view[c] = view_.row(c, y);
  for (int tap = 0; tap < joint_bilateral_taps; ++tap) {
    const int cell = std::clamp(y / factor_ + first_cell(phase, factor_) + tap, 0, height_ - 1);
    for (int index = 0; index < joint_bilateral_planes; ++index) row.cells[tap][index] = plane(index, cell);
  }
  row.start = start_.data();
  row.share = share_.data() + static_cast<ptrdiff_t>(phase) * factor_ * joint_bilateral_taps * joint_bilateral_taps;
  row.factor = factor_;
  row.count = width_;
  row.likeness_per_difference = 1.0f / upsampling_.unlike;
  row.least_likeness = upsampling_.least_likeness;
  row.out = out_.data() + static_cast<ptrdiff_t>(y) * view_.width;
  kernels().joint_bilateral_row(row);
}

void JointBilateralUpsampling::read(const FloatView& disparity, const FloatView& confidence, const PlanarView& view,
                                    const Upsampling& upsampling) {
  view_ = view;
  upsampling_ = upsampling;
  prepare(disparity, factor(disparity, view));
  const auto read_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) read_cells(disparity, confidence, y);
  };
  parallel_for(height_, rows_per_block, read_rows);
}

}  // namespace endosdk
