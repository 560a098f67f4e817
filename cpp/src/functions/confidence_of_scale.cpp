// The confidence, on a grid of twice the size, from the logarithm of the scale of the errors.
#include <algorithm>

#include "functions/function.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr int side = 2;  // pixels of the confidence along a side of a cell

class ConfidenceOfScale : public Function {
 public:
  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(0);
    check_shape("scale", shape, {-1, 1, -1, -1});
    const int64_t rows = shape[2];
    const int64_t cells = shape[3];
    float* confidence = call.float_output(0, {shape[0], 1, side * rows, side * cells});
    if (cells == 0) return;
    const size_t mixed_values = static_cast<size_t>(cells) + 2;
    for (int64_t pair = 0; pair < shape[0]; ++pair) {
      const float* scale = call.floats(0) + pair * rows * cells;
      float* out = confidence + pair * side * side * rows * cells;
      for_each_row(call, scratch_, rows, mixed_values, [&](int64_t y, float* mixed) {
        for (int down = 0; down < side; ++down) {
          const float* beside = scale + std::clamp<int64_t>(y + 2 * down - 1, 0, rows - 1) * cells;
          kernels().confidence_row(
              {scale + y * cells, beside, static_cast<int>(cells), mixed + 1, out + (side * y + down) * side * cells});
        }
      });
    }
  }

 private:
  Scratch scratch_;
};

}  // namespace

std::unique_ptr<Function> make_confidence_of_scale(const FunctionSettings&) { return std::make_unique<ConfidenceOfScale>(); }

}  // namespace endosdk
