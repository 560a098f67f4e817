// The answer of a refinement: the surface found, the nearest or the farthest one around, or what the pictures ask for.
#include <algorithm>

#include "functions/function.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr int side = 2;  // of the grid of the answer, in cells
constexpr int per_cell = side * side;
constexpr int block = 8;  // rows of cells at a time

class ChooseSurface : public Function {
 public:
  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(2);
    check_shape("disparity", shape, {-1, 1, -1, -1});
    const int64_t count = shape[0];
    const int64_t height = shape[2];
    const int64_t width = shape[3];
    check_shape("correction", call.shape(0), {count, per_cell, height, width});
    check_shape("others", call.shape(1), {count, 3 * per_cell, height, width});
    check_shape("steps", call.shape(3), {count, per_cell + 2, height, width});
    const Shape fine = {count, 1, side * height, side * width};
    float* out[3];
    for (int i = 0; i < 3; ++i) out[i] = call.float_output(i, fine);
    if (width == 0) return;
    const int64_t plane = height * width;
    const int blocks = static_cast<int>((height + block - 1) / block);
    const size_t mixed_values = static_cast<size_t>(width) + 2;
    Scratch::Lent memory(scratch_, mixed_values * static_cast<size_t>(blocks));
    const Kernels& kernel = kernels();
    for (int64_t pair = 0; pair < count; ++pair) {
      call.parallel(blocks, [&](int index) {
        for (int64_t y = index * block; y < std::min<int64_t>((index + 1) * block, height); ++y) {
          for (int down = 0; down < side; ++down) {
            const float* disparity = call.floats(2) + pair * plane;
            const int64_t beside = std::clamp<int64_t>(y + 2 * down - 1, 0, height - 1);
            const auto row_of = [&](int input, int planes, int which) {
              return call.floats(input) + (pair * planes + which) * plane + y * width;
            };
            ChooseRow row;
            row.disparity = disparity + y * width;
            row.beside = disparity + beside * width;
            for (int along = 0; along < side; ++along) {
              const int part = side * down + along;
              row.correction[along] = row_of(0, per_cell, part);
              row.belief[along] = row_of(1, 3 * per_cell, part);
              row.to_near[along] = row_of(1, 3 * per_cell, per_cell + part);
              row.to_far[along] = row_of(1, 3 * per_cell, 2 * per_cell + part);
              row.step[along] = row_of(3, per_cell + 2, part);
            }
            row.near = row_of(3, per_cell + 2, per_cell);
            row.far = row_of(3, per_cell + 2, per_cell + 1);
            row.cells = static_cast<int>(width);
            row.mixed = memory.data() + static_cast<size_t>(index) * mixed_values + 1;
            const int64_t first = (pair * height + y) * side * side * width + down * side * width;
            row.answer = out[0] + first;
            row.change = out[1] + first;
            row.rough = out[2] + first;
            kernel.choose_row(row);
          }
        }
      });
    }
  }

 private:
  Scratch scratch_;
};

}  // namespace

std::unique_ptr<Function> make_choose_surface(const FunctionSettings&) { return std::make_unique<ChooseSurface>(); }

}  // namespace endosdk
