#include "maps/temporal_filter.hpp"

#include <algorithm>
#include <cmath>

#include "maps/ramp.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

// As in a Kalman filter, both disparities count by their variance. The variance of the current frame follows from the network's
// confidence. The variance of the previous result follows from all frames that went into it. To it the filter adds this share
// of the current frame's variance, for what may have changed since.
constexpr float drift = 0.02f;
constexpr float least_share = 0.07f;  // of the current frame's disparity, so that the filter forgets a wrong one

constexpr float least_error = 0.8f, most_error = 6.0f;  // network pixels

constexpr int rows_per_block = 16;

// Scale of the Laplace law in which `confidence` is the probability of an error up to one network pixel.
float expected_error(float confidence) {
  const float inside = std::clamp(confidence, 0.01f, 0.99f);
  return std::clamp(-1.0f / std::log(1.0f - inside), least_error, most_error);
}

}  // namespace

void TemporalFilter::smooth(const TemporalInput& input) {
  const Size size = {input.disparity.width, input.disparity.height};
  read_errors(input);
  const bool compared = match_.next(input.left, input.picture);
  if (compared && size == former_size_) {
    // Pixels of the reduced view per cell.
    const double unit = match_.unit();
    move_former(input, {1.0 / (input.cells.y * unit), 1.0 / (input.cells.x * unit)});
    const auto map = [&](const std::vector<float>& values) { return FloatView{values.data(), size.width, size.height}; };
    const FloatView now = {input.disparity.data, size.width, size.height};
    change_.follow({now, map(gate_), map(error_)}, {moved_.data(), size.width, size.height});
    blend(input);
  } else {
    change_.begin_anew();
    variance_.resize(error_.size());
    for (size_t i = 0; i < error_.size(); ++i) variance_[i] = error_[i] * error_[i];
  }
  former_size_ = size;
  former_.assign(input.disparity.data, input.disparity.data + count_of(size));
}

void TemporalFilter::read_errors(const TemporalInput& input) {
  error_.resize(count_of({input.disparity.width, input.disparity.height}));
  const auto read_rows = [&](int begin, int end, int) {
    const auto first = static_cast<size_t>(begin * input.disparity.width);
    const auto last = static_cast<size_t>(end * input.disparity.width);
    for (size_t i = first; i < last; ++i) error_[i] = expected_error(input.confidence.data[i]);
  };
  parallel_for(input.disparity.height, rows_per_block, read_rows);
}

void TemporalFilter::move_former(const TemporalInput& input, Scale scale) {
  const Size size = {input.disparity.width, input.disparity.height};
  const Size reduced = match_.size();
  const float per_x = static_cast<float>(scale.x), per_y = static_cast<float>(scale.y);
  moved_.resize(count_of(size));
  moved_variance_.resize(count_of(size));
  gate_.resize(count_of(size));
  const auto nearest = [](float place, int count) { return std::clamp(static_cast<int>(place + 0.5f), 0, count - 1); };
  const auto move_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      const float at_y = (static_cast<float>(y) + 0.5f) * per_y - 0.5f;
      for (int x = 0; x < size.width; ++x) {
        const auto i = static_cast<size_t>(y * size.width + x);
        const float at_x = (static_cast<float>(x) + 0.5f) * per_x - 0.5f;
        const auto seen = static_cast<size_t>(nearest(at_y, reduced.height) * reduced.width + nearest(at_x, reduced.width));
        const ImageMotion::Shift shift = match_.shifts()[seen];
        const float from_x = static_cast<float>(x) + shift.x / per_x;
        const float from_y = static_cast<float>(y) + shift.y / per_y;
        moved_[i] = sample_bilinear({former_.data(), size.width, size.height}, from_x, from_y);
        moved_variance_[i] = sample_bilinear({variance_.data(), size.width, size.height}, from_x, from_y);
        gate_[i] = match_.agreement()[seen];
      }
    }
  };
  parallel_for(size.height, rows_per_block, move_rows);
}

void TemporalFilter::blend(const TemporalInput& input) {
  const Size size = {input.disparity.width, input.disparity.height};
  const auto blend_rows = [&](int begin, int end, int) {
    const auto first = static_cast<size_t>(begin * size.width);
    const auto last = static_cast<size_t>(end * size.width);
    for (size_t i = first; i < last; ++i) {
      const float own = error_[i] * error_[i];
      variance_[i] = own;
      const float difference = input.disparity.data[i] - moved_[i];
      const float former = moved_variance_[i] + drift * own;
      const float error = std::sqrt(own + former);
      const float trust = gate_[i] * ramp(std::abs(difference), agreeing * error, disagreeing * error);
      if (!(trust > 0.0f)) continue;
      const float share = std::max(least_share, former / (former + own));
      input.disparity.data[i] -= (1.0f - share) * trust * difference;
      variance_[i] = own * (1.0f - trust * (1.0f - share));
    }
  };
  parallel_for(size.height, rows_per_block, blend_rows);
}

}  // namespace endosdk
