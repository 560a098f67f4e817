#include "maps/row_disparity.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/kernels.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

// The first, coarse passes take only every `coarse_every`-th band.
constexpr int first_band = 2;
constexpr int coarse_every = 3;
constexpr int most_coarse_passes = 6;

// Radians: the coarse passes end when no rotation changes by more.
constexpr double settled = 0.0005;

// The information of a window is the sum of its gradients along y that a wrong disparity does not explain. A window with less
// than `least_information` tells nothing. From `enough_information` on, more tells little more: the remaining error is no
// noise.
constexpr float least_information = 2.0f;
constexpr float enough_information = 20.0f;
constexpr float ridge = 0.1f;  // keeps windows without gradients along x from dividing by zero

// Longest step, in rows of brightness, that is taken for right. Later passes begin near the answer.
constexpr float longest_step = 2.0f;

// Columns of brightness, of 480 or so: a part of the picture fits the rig if its matches lie nearer to their rows.
constexpr float least_misfit = 0.4f;

constexpr double least_focal = 1.0;  // px; with a shorter one, or none, a rig says nothing about rows

bool near_enough(const PoseVector& before, const PoseVector& after) {
  double most = 0.0;
  for (size_t i = 0; i < 3; ++i) most = std::max(most, std::abs(after[i] - before[i]));
  return most < settled;
}

int first_row(int band) { return first_band + RowDisparity::band_period * band; }

}  // namespace

const PoseError& RowDisparity::measure(const MatchedViews& views, const FloatView& confidence, Scale grid, Scale frame,
                                       const PosePattern& pattern) {
  views_ = &views;
  pattern_ = pattern;
  const Size cells = views.size();
  column_ = {2.0 * views.unit() * frame.y, views.unit() * frame.x};
  bands_ = cells.height >= 2 * first_band + 1 ? (cells.height - 1 - 2 * first_band) / band_period + 1 : 0;
  along_ = std::max(0, (cells.width - 1) / cells_along);
  // Allocates all memory before any early return, so that frames after the first allocate nothing.
  scratch_size_ = (row_step_sums + 1) * cells.width;
  const int workers = thread_count();
  scratch_.resize(static_cast<size_t>(workers) * static_cast<size_t>(scratch_size_));
  wanted_.resize(static_cast<size_t>(3 * bands_) * static_cast<size_t>(cells.width));
  columns_.resize(static_cast<size_t>(cells.width));
  measurements_.resize(bands_ * along_);
  rest_.reserve(static_cast<size_t>(bands_ * along_ + fit_lanes));
  misfit_.prepare(bands_, along_);
  error_ = {};
  if (bands_ == 0 || along_ == 0 || pattern.focal_x < least_focal) return error_;
  const double noise = std::max(views.left_noise(), views.right_noise());
  flat_ = least_information + row_window_cells * static_cast<float>(noise * noise / (8.0 * views.unit() * views.unit()));
  find_wanted(confidence, grid);
  for (int i = 0; i < most_coarse_passes; ++i) {
    const PoseVector before = error_.value;
    pass(coarse_every);
    if (!measurements_.refine(error_.value)) return error_ = {};
    if (near_enough(before, error_.value)) break;
  }
  pass(1);
  if (!measurements_.refine(error_.value)) return error_ = {};
  measurements_.finish(error_);
  measurements_.left_over(rest_);
  misfit_.find(rest_, least_misfit * static_cast<float>(column_.x));
  error_.measured = true;
  return error_;
}

void RowDisparity::find_wanted(const FloatView& confidence, Scale grid) {
  const Size cells = views_->size();
  for (int x = 0; x < cells.width; ++x) columns_[static_cast<size_t>(x)] = views_->place_of(x, grid.x, confidence.width);
  float* out = wanted_.data();
  for (int i = 0; i < 3 * bands_; ++i, out += cells.width) {
    const int from = views_->place_of(first_row(i / 3) + i % 3 - 1, grid.y, confidence.height);
    const float* const source = confidence.data + static_cast<ptrdiff_t>(from) * confidence.width;
    for (int x = 0; x < cells.width; ++x) {
      out[x] = source[columns_[static_cast<size_t>(x)]] >= row_disparity_confidence ? 1.0f : 0.0f;
    }
  }
}

// Measures every `every`-th band. Measurements of other bands are discarded.
void RowDisparity::pass(int every) {
  const int apart = bands_ >= every ? every : 1;
  const int measured = (bands_ + apart - 1 - apart / 2) / apart;
  measurements_.resize(measured * along_);
  const auto bands = [&](int begin, int end, int worker) {
    for (int i = begin; i < end; ++i) measure_band(apart / 2 + i * apart, i * along_, worker);
  };
  parallel_for(measured, 1, bands, static_cast<int>(scratch_.size()) / scratch_size_);
}

// Measures one band; its measurements begin at `first`.
void RowDisparity::measure_band(int band, int first, int worker) {
  const Size cells = views_->size();
  const int row = first_row(band);
  float* const sums = scratch_of(worker);
  float* const offset = sums + static_cast<ptrdiff_t>(row_step_sums) * cells.width;
  std::fill(sums, offset, 0.0f);
  const float* const disparity = views_->disparity(row);
  const auto across = static_cast<float>(column_.x);
  const auto down = static_cast<float>(column_.y);
  const double y = (row + 0.5) * column_.y - 0.5;
  const PosePattern::Line line = pattern_.line(error_.value, y);
  const auto first_place = static_cast<float>(0.5 * column_.x - 0.5);
  const auto gain = static_cast<float>(views_->gain());
  for (int i = 0; i < cells.width; ++i) {
    offset[i] = line.at(first_place + 2.0f * across * static_cast<float>(i), across * disparity[i]) * (1.0f / down);
  }
  for (int r = 0; r < 3; ++r) {
    const int here = row + r - 1;
    kernels().row_step_row({views_->left(0), views_->right(0), 2 * cells.width, cells.height, here, cells.width,
                            views_->disparity(here), offset,
                            wanted_.data() + static_cast<ptrdiff_t>(3 * band + r) * cells.width, gain, sums});
  }
  const PoseMeasurements::Span out = measurements_.from(first);
  kernels().row_windows({sums, cells.width, along_, ridge, flat_, enough_information, longest_step, out.rest, out.weight});
  const PosePattern pattern = pattern_;
  for (int i = 0; i < along_; ++i) {
    const int cell = 2 * i + 1;
    const auto x = static_cast<float>((2 * cell + 0.5) * column_.x - 0.5);
    const float found = disparity[cell];
    const std::array<float, pose_terms> rows = pattern.rows(x, static_cast<float>(y), across * (out.weight[i] > 0.0f ? found : 0.0f));
    for (size_t t = 0; t < pose_terms; ++t) out.rows[t][i] = rows[t];
    out.rest[i] *= down;
  }
  for (int part = 0; part < pose_blocks_across; ++part) {
    const auto begin = [&](int of) { return (of * along_ + pose_blocks_across - 1) / pose_blocks_across; };
    std::fill(out.block + begin(part), out.block + begin(part + 1), band * pose_blocks_down / bands_ * pose_blocks_across + part);
  }
}

}  // namespace endosdk
