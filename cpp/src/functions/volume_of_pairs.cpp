// Differences of the features of both views, for pairs of planes, in 8-bit integers.
#include <algorithm>
#include <cstring>

#include "functions/function.hpp"
#include "kernels/kernels.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

constexpr int pair = 2;  // planes that lie together
constexpr int most_planes = 128;

// Inputs: three for the features of each view (values, scale, zero point), then scale and zero point of the result.
constexpr int own_input = 0;
constexpr int other_input = 3;
constexpr int result_input = 6;

class VolumeOfPairs : public Function {
 public:
  VolumeOfPairs(int dense, int sparse) : dense_(dense), sparse_(sparse) {
    const bool fits = dense > 0 && sparse >= 0 && dense % pair == 0 && sparse % pair == 0 && dense + sparse <= most_planes;
    require(fits, ENDO_MODEL_METADATA, "planes", Text("must be even numbers, together up to ", most_planes), dense + sparse);
  }

  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(own_input);
    check_shape("own", shape, {-1, -1, -1, -1});
    check_shape("own", shape, {shape[0], shape[1], shape[2], shape[3] / pair * pair});
    check_shape("other", call.shape(other_input), shape);
    for (const int input : {own_input + 1, own_input + 2, other_input + 1, other_input + 2, result_input, result_input + 1}) {
      check_shape("steps", call.shape(input), {});
    }
    const int64_t height = shape[1];
    const int width = static_cast<int>(shape[2]);
    const int channels = static_cast<int>(shape[3] / pair);
    const int pairs = (dense_ + sparse_) / pair;
    auto* out = static_cast<uint8_t*>(call.output(0, {shape[0], pairs, height, width, shape[3]}));
    if (width == 0 || channels == 0) return;
    const SumOfBytes steps = steps_of(call);
    const int64_t row = int64_t{width} * pair * channels;
    const size_t moved_values = static_cast<size_t>(row) / sizeof(float) + 1;
    for (int64_t image = 0; image < shape[0]; ++image) {
      for_each_row(call, scratch_, height, moved_values, [&](int64_t y, float* memory) {
        auto* const moved = reinterpret_cast<uint8_t*>(memory);
        const uint8_t* own = call.bytes(own_input) + (image * height + y) * row;
        const uint8_t* other = call.bytes(other_input) + (image * height + y) * row;
        for (int p = 0; p < pairs; ++p) {
          move_row(other, width, channels, p, moved);
          kernels().add_bytes(own, moved, steps, static_cast<int>(row), out + ((image * pairs + p) * height + y) * row);
        }
      });
    }
  }

 private:
  static SumOfBytes steps_of(const FunctionCall& call) {
    const float scale = call.floats(result_input)[0];
    const auto part = [&](int input) { return call.floats(input + 1)[0] / scale; };
    const auto zero = [&](int input) { return static_cast<float>(call.bytes(input)[0]); };
    SumOfBytes steps;
    steps.first = part(own_input);
    steps.second = part(other_input);
    steps.least = zero(result_input + 1);
    steps.constant = steps.least - zero(own_input + 2) * steps.first - zero(other_input + 2) * steps.second;
    return steps;
  }

  // Writes the row of the other view as the planes of a pair see it. Before its first pixel, the first pixel is repeated.
  void move_row(const uint8_t* other, int width, int channels, int p, uint8_t* moved) const {
    const auto size = static_cast<size_t>(channels);
    const int dense_pairs = dense_ / pair;
    if (p < dense_pairs) {
      const int shift = std::min(p, width);
      for (int x = 0; x < shift; ++x) std::memcpy(moved + x * pair * channels, other, pair * size);
      std::memcpy(moved + shift * pair * channels, other, pair * size * static_cast<size_t>(width - shift));
      return;
    }
    // Beyond the dense planes, only the even planes are there. Their features come first.
    for (int place = 0; place < pair; ++place) {
      const int shift = dense_pairs + pair * (p - dense_pairs) + place;
      for (int x = 0; x < width; ++x) {
        std::memcpy(moved + (pair * x + place) * channels, other + std::max(x - shift, 0) * pair * channels, size);
      }
    }
  }

  Scratch scratch_;
  int dense_;
  int sparse_;
};

}  // namespace

std::unique_ptr<Function> make_volume_of_pairs(const FunctionSettings& settings) {
  return std::make_unique<VolumeOfPairs>(static_cast<int>(settings("dense")), static_cast<int>(settings("sparse")));
}

}  // namespace endosdk
