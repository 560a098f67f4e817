// Computes the disparity from the costs of planes, and the part of their spread that is uncertainty.
#include <algorithm>
#include <vector>

#include "functions/function.hpp"
#include "kernels/kernels.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

constexpr int side = 2;             // cells of the answer along a side of a cell of the costs
constexpr int per_cell = side * side;
constexpr int cells_at_once = soft_argmin_width / per_cell;
constexpr int most_planes = 128;
constexpr int block = 4;  // rows of cells at a time

class AnswerOfPlanes : public Function {
 public:
  AnswerOfPlanes(int dense, int sparse, int reach) : planes_(dense + sparse), dense_(dense), gap_(sparse > 0 ? 2.0f : 1.0f) {
    const bool fits = dense > 0 && sparse >= 0 && planes_ % side == 0 && planes_ <= most_planes;
    require(fits, ENDO_MODEL_METADATA, "planes", Text("must be an even number up to ", most_planes), planes_);
    reach_ = static_cast<float>(reach > 0 ? reach : planes_);
    // The even planes come first, then the odd ones, as in the costs.
    for (int place = 0; place < side; ++place) {
      for (int plane = place; plane < planes_; plane += side) {
        index_.push_back(static_cast<float>(plane));
        value_.push_back(static_cast<float>(plane < dense ? plane : 2 * plane - dense));
      }
    }
  }

  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(1);
    check_shape("correction", shape, {-1, -1, -1, int64_t{planes_} * per_cell});
    const int64_t count = shape[0];
    const int64_t height = shape[1];
    const int64_t width = shape[2];
    check_shape("cost", call.shape(0), {count, side, planes_ / side, height * width, per_cell});
    float* mean = call.float_output(0, {count, 1, side * height, side * width});
    float* excess = call.float_output(1, {count, 1, side * height, side * width});
    if (width == 0) return;
    // This memory is not on the stack, because a thread of a device may have a small stack.
    const size_t values = static_cast<size_t>(planes_) * soft_argmin_width;
    const int64_t blocks = (count * height + block - 1) / block;
    Scratch::Lent memory(scratch_, values * static_cast<size_t>(blocks));
    call.parallel(blocks, [&](int index) {
      float* const costs = memory.data() + static_cast<size_t>(index) * values;
      const int64_t begin = int64_t{index} * block;
      for (int64_t row = begin; row < std::min(begin + block, count * height); ++row) {
        const int64_t pair = row / height;
        const float* cost = call.floats(0) + (pair * planes_ * height + row % height) * width * per_cell;
        const float* correction = call.floats(1) + row * width * planes_ * per_cell;
        const int64_t first = row * side * side * width;
        answer_row(cost, height * width * per_cell, correction, static_cast<int>(width), costs, mean + first, excess + first);
      }
    });
  }

 private:
  void answer_row(const float* cost, int64_t plane_stride, const float* correction, int width, float* costs, float* mean,
                  float* excess) const {
    float found[2][soft_argmin_width];
    for (int first = 0; first < width; first += cells_at_once) {
      const int cells = std::min(cells_at_once, width - first);
      for (int p = 0; p < planes_; ++p) {
        float* out = costs + p * soft_argmin_width;
        const float* own = cost + p * plane_stride + first * per_cell;
        for (int x = 0; x < cells; ++x) {
          const float* moved = correction + (static_cast<int64_t>(first + x) * planes_ + p) * per_cell;
          for (int i = 0; i < per_cell; ++i) out[per_cell * x + i] = own[per_cell * x + i] + moved[i];
        }
        for (int x = per_cell * cells; x < soft_argmin_width; ++x) out[x] = 0.0f;
      }
      kernels().soft_argmin_cells({costs, index_.data(), value_.data(), planes_, reach_, static_cast<float>(dense_), gap_, found[0], found[1]});
      for (int map = 0; map < 2; ++map) {
        float* out = map == 0 ? mean : excess;
        for (int x = 0; x < cells; ++x) {
          for (int i = 0; i < per_cell; ++i) {
            out[i / side * side * width + side * (first + x) + i % side] = found[map][per_cell * x + i];
          }
        }
      }
    }
  }

  Scratch scratch_;
  int planes_;
  int dense_;
  float gap_;
  float reach_;
  std::vector<float> index_;
  std::vector<float> value_;
};

}  // namespace

std::unique_ptr<Function> make_answer_of_planes(const FunctionSettings& settings) {
  const auto whole = [&](const char* name) { return static_cast<int>(settings(name)); };
  return std::make_unique<AnswerOfPlanes>(whole("dense"), whole("sparse"), whole("reach"));
}

}  // namespace endosdk
