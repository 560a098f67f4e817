// The confidence, on a grid of twice the size, from the logarithm of the scale of the errors.
#include <algorithm>

#include "functions/function.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr int side = 2;   // pixels of the confidence along a side of a cell
constexpr int block = 8;  // rows of cells at a time

class ConfidenceOfScale : public Function {
 public:
  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(0);
    check_shape("scale", shape, {-1, 1, -1, -1});
    const int64_t rows = shape[2];
    const int64_t cells = shape[3];
    float* confidence = call.float_output(0, {shape[0], 1, side * rows, side * cells});
    if (cells == 0) return;
    const int64_t blocks = (rows + block - 1) / block;
    const size_t mixed_values = static_cast<size_t>(cells) + 2;
    Scratch::Lent memory(scratch_, mixed_values * static_cast<size_t>(blocks));
    for (int64_t pair = 0; pair < shape[0]; ++pair) {
      const float* scale = call.floats(0) + pair * rows * cells;
      float* out = confidence + pair * side * side * rows * cells;
      call.parallel(blocks, [&](int index) {
        float* const mixed = memory.data() + static_cast<size_t>(index) * mixed_values + 1;
        const int64_t first = int64_t{index} * block;
        for (int64_t y = first; y < std::min(first + block, rows); ++y) {
          for (int down = 0; down < side; ++down) {
            const float* beside = scale + std::clamp<int64_t>(y + 2 * down - 1, 0, rows - 1) * cells;
            kernels().confidence_row(
                {scale + y * cells, beside, static_cast<int>(cells), mixed, out + (side * y + down) * side * cells});
          }
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
