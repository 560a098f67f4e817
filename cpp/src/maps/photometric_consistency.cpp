#include "maps/photometric_consistency.hpp"

#include <algorithm>
#include <cmath>

#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int step = 2;  // every second pixel of every second row is enough to tell, and a quarter of the work

int cell_of(int position, double cells, int count) {
  return std::min(static_cast<int>((position + 0.5) * cells), count - 1);
}

int samples_of(int length) { return (length + step - 1) / step; }

}  // namespace

FloatView PhotometricConsistency::supported(const FloatView& disparity, const FloatView& confidence, const PlanarView& left,
                               const PlanarView& right, Size picture, Scale cells, bool same_frames) {
  picture_ = picture;
  block_ = std::max(smallest_block, picture.width / blocks_per_width / step * step);
  blocks_ = {(picture.width + block_ - 1) / block_, (picture.height + block_ - 1) / block_};
  const int samples = samples_of(picture.width);
  cell_of_sample_.resize(static_cast<size_t>(samples));
  for (int i = 0; i < samples; ++i) cell_of_sample_[static_cast<size_t>(i)] = cell_of(i * step, cells.x, disparity.width);
  const int workers = thread_count();
  columns_.resize(static_cast<size_t>(workers));
  for (Columns& columns : columns_) columns.resize(static_cast<size_t>(samples));
  verdicts_.resize(static_cast<size_t>(blocks_.width) * static_cast<size_t>(blocks_.height));
  const auto judge_rows = [&](int begin, int end, int worker) {
    for (int row = begin; row < end; ++row) judge_row(row, worker, disparity, left, right, cells);
  };
  parallel_for(blocks_.height, 1, judge_rows, workers);

  const auto at_least = [&](Verdict least) {
    return std::count_if(verdicts_.begin(), verdicts_.end(), [&](Verdict v) { return v >= least; });
  };
  belong_together_ = !same_frames && at_least(Verdict::strong) * strong_is_one_in >= at_least(Verdict::weak);
  return without_unsupported(confidence, cells);
}

FloatView PhotometricConsistency::without_unsupported(const FloatView& confidence, Scale cells) {
  const auto block_of = [this](int cell, double cells_per_pixel, int count) {
    return std::min(static_cast<int>((cell + 0.5) / cells_per_pixel) / block_, count - 1);
  };
  block_of_cell_.resize(static_cast<size_t>(confidence.width));
  for (int x = 0; x < confidence.width; ++x) block_of_cell_[static_cast<size_t>(x)] = block_of(x, cells.x, blocks_.width);
  confidence_.resize(static_cast<size_t>(confidence.width) * static_cast<size_t>(confidence.height));
  const float* in = confidence.data;
  float* out = confidence_.data();
  for (int y = 0; y < confidence.height; ++y) {
    const Verdict* const verdicts = verdicts_.data() + static_cast<ptrdiff_t>(block_of(y, cells.y, blocks_.height)) * blocks_.width;
    for (const int32_t block_x : block_of_cell_) {
      const Verdict verdict = verdicts[block_x];
      const bool unsupported = verdict == Verdict::flat || verdict == Verdict::weak || !belong_together_;
      *out++ = unsupported ? 0.0f : *in;
      ++in;
    }
  }
  return {confidence_.data(), confidence.width, confidence.height};
}

void PhotometricConsistency::judge_row(int row, int worker, const FloatView& disparity, const PlanarView& left, const PlanarView& right,
                          Scale cells) {
  constexpr int green = 1;
  Columns& columns = columns_[static_cast<size_t>(worker)];
  columns.clear();
  const int bottom = std::min((row + 1) * block_, picture_.height);
  for (int y = row * block_; y < bottom; y += step) {
    const float* const found = disparity.data + int64_t{cell_of(y, cells.y, disparity.height)} * disparity.width;
    const uint8_t* const here = left.row(green, y);
    const uint8_t* const there = right.row(green, y);
    int x = 0;
    for (size_t i = 0; i < cell_of_sample_.size(); ++i, x += step) {
      const float d = found[cell_of_sample_[i]];
      const bool inside = d >= 0.0f && d <= static_cast<float>(x);  // what is no number is not
      columns.matched[i] = inside;
      columns.here[i] = inside ? here[x] : int16_t{0};
      columns.there[i] = inside ? there[x - static_cast<int>(d + 0.5f)] : int16_t{0};
    }
    columns.add_row();
  }
  const size_t per_block = static_cast<size_t>(block_ / step);
  for (int column = 0; column < blocks_.width; ++column) {
    const size_t begin = static_cast<size_t>(column) * per_block;
    const Sums sums = columns.sum(begin, std::min(begin + per_block, cell_of_sample_.size()));
    verdicts_[static_cast<size_t>(row * blocks_.width + column)] = judge(sums);
  }
}

void PhotometricConsistency::Columns::resize(size_t samples) {
  for (auto* values : {&matched, &here, &there}) values->resize(samples);
  for (auto* values : {&count, &left, &right, &left_left, &right_right, &left_right}) values->resize(samples);
}

void PhotometricConsistency::Columns::clear() {
  for (auto* values : {&count, &left, &right, &left_left, &right_right, &left_right}) std::fill(values->begin(), values->end(), 0);
}

void PhotometricConsistency::Columns::add_row() {
  const size_t samples = here.size();
  const auto add = [samples](std::vector<int32_t>& to, const int16_t* a) {
    int32_t* __restrict sum = to.data();
    for (size_t i = 0; i < samples; ++i) sum[i] += a[i];
  };
  const auto add_product = [samples](std::vector<int32_t>& to, const int16_t* a, const int16_t* b) {
    int32_t* __restrict sum = to.data();
    for (size_t i = 0; i < samples; ++i) sum[i] += a[i] * b[i];
  };
  add(count, matched.data());
  add(left, here.data());
  add(right, there.data());
  add_product(left_left, here.data(), here.data());
  add_product(right_right, there.data(), there.data());
  add_product(left_right, here.data(), there.data());
}

PhotometricConsistency::Sums PhotometricConsistency::Columns::sum(size_t begin, size_t end) const {
  Sums s;
  for (size_t i = begin; i < end; ++i) {
    s.count += count[i];
    s.left += left[i];
    s.right += right[i];
    s.left_left += left_left[i];
    s.right_right += right_right[i];
    s.left_right += left_right[i];
  }
  return s;
}

PhotometricConsistency::Verdict PhotometricConsistency::judge(const Sums& s) const {
  const int64_t n = s.count;
  if (n < block_ * block_ / (step * step) / 4) return Verdict::not_judged;
  const int64_t together = n * s.left_right - s.left * s.right;
  const int64_t left_varies = n * s.left_left - s.left * s.left;
  const int64_t right_varies = n * s.right_right - s.right * s.right;
  if (left_varies == 0) return Verdict::flat;
  const double scale = std::sqrt(static_cast<double>(left_varies) * static_cast<double>(right_varies));
  if (static_cast<double>(together) <= weakest * scale) return Verdict::weak;
  return static_cast<double>(together) < strong * scale ? Verdict::fair : Verdict::strong;
}

}  // namespace endosdk
