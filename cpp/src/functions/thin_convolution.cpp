// A convolution with four outputs. Runtimes compute as many as their vectors hold, four times as many.
#include <algorithm>
#include <limits>

#include "functions/function.hpp"
#include "functions/thin_layer.hpp"
#include "kernels/kernels.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

constexpr int outputs = 4;
constexpr int margin = 1;  // cells beside each row
constexpr int most_inputs_of_layer = 128;
constexpr int block = 8;  // rows at a time

class ThinConvolution : public Function {
 public:
  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(0);
    check_shape("values", shape, {-1, -1, -1, -1});
    const int inputs = static_cast<int>(shape[1]);
    const int rows = static_cast<int>(shape[2]);
    const int cells = static_cast<int>(shape[3]);
    require(inputs <= most_inputs_of_layer, ENDO_INFERENCE_FAILED, "values", Text("must have at most ", most_inputs_of_layer, " channels"),
            inputs);
    check_shape("weights", call.shape(1), {outputs, inputs, thin_window, thin_window});
    check_shape("bias", call.shape(2), {outputs});
    float* out = call.float_output(0, {shape[0], outputs, rows, cells});
    if (cells == 0) return;
    const int64_t plane = int64_t{rows} * cells;
    const int blocks = (rows + block - 1) / block;
    const int row_values = margin + padded_cells(cells) + margin;
    // The rows of a block with the row before and the row after it, [input][row], and the taps of a row.
    const auto copied = static_cast<size_t>(inputs) * (block + 2) * static_cast<size_t>(row_values);
    const auto weight_values = static_cast<size_t>(outputs * thin_taps) * static_cast<size_t>(inputs);
    Scratch::Lent memory(scratch_, weight_values + copied * static_cast<size_t>(blocks));
    float* const weights = memory.data();
    turn_weights(call.floats(1), inputs * thin_taps, outputs, weights);
    for (int64_t i = 0; i < shape[0]; ++i) {
      const float* values = call.floats(0) + i * inputs * plane;
      call.parallel(blocks, [&](int index) {
        float* const own = weights + weight_values + static_cast<size_t>(index) * copied;
        const int first = index * block;
        const int last = std::min(first + block, rows);
        for (int c = 0; c < inputs; ++c) {
          for (int y = first - 1; y <= last; ++y) {
            float* const copy = own + (c * (block + 2) + y - first + 1) * row_values;
            std::fill_n(copy, row_values, 0.0f);  // beyond the map, there is nothing
            if (y >= 0 && y < rows) std::copy_n(values + c * plane + int64_t{y} * cells, cells, copy + margin);
          }
        }
        const float* taps[most_inputs_of_layer * thin_taps];
        for (int y = first; y < last; ++y) {
          const float** next = taps;
          for (int c = 0; c < inputs; ++c) {
            const auto line = [&](int from) { return own + (c * (block + 2) + from - first + 1) * row_values + margin; };
            next = name_taps(y, 1, line, next);
          }
          kernels().thin_row({taps, inputs * thin_taps, outputs, weights, call.floats(2), std::numeric_limits<float>::lowest(), cells,
                              out + i * outputs * plane + int64_t{y} * cells, static_cast<ptrdiff_t>(plane)});
        }
      });
    }
  }

 private:
  Scratch scratch_;
};

}  // namespace

std::unique_ptr<Function> make_thin_convolution(const FunctionSettings&) { return std::make_unique<ThinConvolution>(); }

}  // namespace endosdk
