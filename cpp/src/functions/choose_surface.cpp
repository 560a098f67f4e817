// The result of a refinement. Each pixel starts from the disparity found. The network's correction and the step that the
// pictures ask for are added. The pixel may also move towards the nearest or the farthest surface around.
#include <algorithm>

#include "functions/function.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr int side = 2;  // pixels of the answer along a side of a cell
constexpr int per_cell = side * side;

// Inputs and outputs of one call, and the places where their rows begin.
class Surfaces {
 public:
  explicit Surfaces(FunctionCall& call) : call_(call) {
    const Shape shape = call.shape(2);
    check_shape("disparity", shape, {-1, 1, -1, -1});
    count_ = shape[0];
    height_ = shape[2];
    width_ = shape[3];
    check_shape("correction", call.shape(0), {count_, per_cell, height_, width_});
    check_shape("others", call.shape(1), {count_, 3 * per_cell, height_, width_});
    check_shape("steps", call.shape(3), {count_, per_cell + 2, height_, width_});
    for (int i = 0; i < 3; ++i) out_[i] = call.float_output(i, {count_, 1, side * height_, side * width_});
  }

  int64_t count() const { return count_; }
  int64_t height() const { return height_; }
  int64_t width() const { return width_; }

  // One of the two rows of the answer that belong to row y of the cells.
  ChooseRow row(int64_t pair, int64_t y, int down, float* mixed) const {
    const int64_t plane = height_ * width_;
    const auto plane_row = [&](int input, int planes, int which) {
      return call_.floats(input) + (pair * planes + which) * plane + y * width_;
    };
    const float* disparity = call_.floats(2) + pair * plane;
    ChooseRow row;
    row.disparity = disparity + y * width_;
    row.beside = disparity + std::clamp<int64_t>(y + 2 * down - 1, 0, height_ - 1) * width_;
    for (int along = 0; along < side; ++along) {
      const int part = side * down + along;
      row.correction[along] = plane_row(0, per_cell, part);
      row.belief[along] = plane_row(1, 3 * per_cell, part);
      row.to_near[along] = plane_row(1, 3 * per_cell, per_cell + part);
      row.to_far[along] = plane_row(1, 3 * per_cell, 2 * per_cell + part);
      row.step[along] = plane_row(3, per_cell + 2, part);
    }
    row.near = plane_row(3, per_cell + 2, per_cell);
    row.far = plane_row(3, per_cell + 2, per_cell + 1);
    row.cells = static_cast<int>(width_);
    row.mixed = mixed;
    const int64_t first = (side * (pair * height_ + y) + down) * side * width_;
    row.answer = out_[0] + first;
    row.change = out_[1] + first;
    row.rough = out_[2] + first;
    return row;
  }

 private:
  FunctionCall& call_;
  int64_t count_ = 0;
  int64_t height_ = 0;
  int64_t width_ = 0;
  float* out_[3];
};

class ChooseSurface : public Function {
 public:
  void compute(FunctionCall& call) override {
    const Surfaces surfaces(call);
    if (surfaces.width() == 0) return;
    const size_t mixed_values = static_cast<size_t>(surfaces.width()) + 2;
    for (int64_t pair = 0; pair < surfaces.count(); ++pair) {
      for_each_row(call, scratch_, surfaces.height(), mixed_values, [&](int y, float* mixed) {
        for (int down = 0; down < side; ++down) kernels().choose_row(surfaces.row(pair, y, down, mixed + 1));
      });
    }
  }

 private:
  Scratch scratch_;
};

}  // namespace

std::unique_ptr<Function> make_choose_surface(const FunctionSettings&) { return std::make_unique<ChooseSurface>(); }

}  // namespace endosdk
