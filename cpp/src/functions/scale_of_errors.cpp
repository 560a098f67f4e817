// The logarithm of the scale of the errors: a weighted sum of the evidence, and of what four thin layers make of all evidence
// and clues around.
#include <algorithm>
#include <array>

#include "functions/function.hpp"
#include "functions/thin_layer.hpp"
#include "kernels/kernels.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

constexpr std::array<int, 3> distances = {1, 2, 4};  // cells between the taps of the layers
constexpr int margin = 4;                            // cells beside each row, for the longest distance
constexpr int thin_outputs = 8;
constexpr int taps = thin_outputs * thin_taps;  // inputs of a layer that looks around
constexpr float largest_log = 4.6f;
constexpr int most_planes = 256;  // of evidence and clues
// Inputs: evidence, clues, weights and biases of the first layer and of the layers around, weights of the sum.
constexpr int weight_input = 2;
constexpr int sum_input = 2 + 2 + 2 * static_cast<int>(distances.size());

// The parts of a call, and the places of its values in memory.
class Survey {
 public:
  explicit Survey(const FunctionCall& call) : call_(call) {
    const Shape shape = call.shape(0);
    check_shape("evidence", shape, {-1, -1, -1, -1});
    count = shape[0];
    evidence = static_cast<int>(shape[1]);
    rows = static_cast<int>(shape[2]);
    cells = static_cast<int>(shape[3]);
    check_shape("clues", call.shape(1), {count, -1, rows, cells});
    inputs = evidence + static_cast<int>(call.shape(1)[1]);
    require(inputs <= most_planes, ENDO_INFERENCE_FAILED, "clues", Text("must have at most ", most_planes, " planes with the evidence"),
            inputs);
    check_shape("first weights", call.shape(weight_input), {thin_outputs, inputs, 1, 1});
    check_shape("first bias", call.shape(weight_input + 1), {thin_outputs});
    for (size_t i = 0; i < distances.size(); ++i) {
      const int place = layer_input(i);
      check_shape("weights", call.shape(place), {thin_outputs, thin_outputs, thin_window, thin_window});
      check_shape("bias", call.shape(place + 1), {thin_outputs});
    }
    check_shape("sum", call.shape(sum_input), {1 + evidence + thin_outputs});
    padded = padded_cells(cells);
  }

  static int layer_input(size_t layer) { return weight_input + 2 + 2 * static_cast<int>(layer); }

  // A row of a layer, with a margin at both ends.
  int row_values() const { return margin + padded + margin; }
  size_t map_values() const { return static_cast<size_t>(rows) * thin_outputs * static_cast<size_t>(row_values()); }
  size_t input_values() const { return static_cast<size_t>(inputs) * static_cast<size_t>(padded); }
  size_t scratch_values() const { return std::max(input_values(), static_cast<size_t>(thin_outputs * row_values())); }

  size_t weight_values() const { return static_cast<size_t>(thin_outputs * (inputs + static_cast<int>(distances.size()) * taps)); }

  float* turn(int place, int layer_inputs, float* weights) const {
    return turn_weights(call_.floats(place), layer_inputs, thin_outputs, weights);
  }

  const float* plane_row(int64_t pair, int plane, int y) const {
    const bool own = plane < evidence;
    const int64_t planes = own ? evidence : inputs - evidence;
    const float* values = call_.floats(own ? 0 : 1);
    return values + ((pair * planes + (own ? plane : plane - evidence)) * rows + y) * cells;
  }

  int64_t count = 0;
  int evidence = 0;
  int inputs = 0;
  int rows = 0;
  int cells = 0;
  int padded = 0;

 private:
  const FunctionCall& call_;
};

class ScaleOfErrors : public Function {
 public:
  void compute(FunctionCall& call) override {
    const Survey survey(call);
    float* scale = call.float_output(0, {survey.count, 1, survey.rows, survey.cells});
    if (survey.cells == 0) return;
    const size_t map_values = survey.map_values();
    const auto row_values = static_cast<size_t>(survey.row_values());
    Scratch::Lent memory(scratch_, 2 * map_values + row_values + survey.weight_values());
    float* maps[2] = {memory.data(), memory.data() + map_values};
    float* nothing = memory.data() + 2 * map_values;
    std::fill_n(nothing, row_values, 0.0f);
    float* const first = nothing + row_values;
    std::array<float*, distances.size()> layers;
    float* next = survey.turn(weight_input, survey.inputs, first);
    for (size_t i = 0; i < layers.size(); ++i) {
      layers[i] = next;
      next = survey.turn(Survey::layer_input(i), taps, next);
    }
    const auto each_row = [&](const auto& body) { for_each_row(call, row_scratch_, survey.rows, survey.scratch_values(), body); };
    for (int64_t pair = 0; pair < survey.count; ++pair) {
      each_row([&](int y, float* own) { mix(call, survey, pair, y, first, own, maps[0]); });
      for (size_t i = 0; i < layers.size(); ++i) {
        const float* from = maps[i % 2];
        float* to = maps[(i + 1) % 2];
        const float* bias = call.floats(Survey::layer_input(i) + 1);
        const bool last = i + 1 == layers.size();
        each_row([&](int y, float* own) {
          float* row = last ? own : map_row(survey, to, y);
          look_around(survey, from, nothing, y, distances[i], layers[i], bias, row);
          if (last) add_up(call, survey, pair, y, row, scale + (pair * survey.rows + y) * survey.cells);
        });
      }
    }
  }

 private:
  static float* map_row(const Survey& survey, float* map, int y) { return map + static_cast<ptrdiff_t>(y) * thin_outputs * survey.row_values(); }

  static void compute_row(const Survey& survey, const float* const* inputs, int count, const float* weights,
                          const float* bias, float* row) {
    kernels().thin_row({inputs, count, thin_outputs, weights, bias, 0.0f, survey.cells, row + margin, survey.row_values()});
    // Beyond the map, there is nothing. Vectors of the next layer also read what follows the last cell.
    for (int o = 0; o < thin_outputs; ++o) {
      float* const out = row + o * survey.row_values();
      std::fill_n(out, margin, 0.0f);
      std::fill(out + margin + survey.cells, out + survey.row_values(), 0.0f);
    }
  }

  static void mix(const FunctionCall& call, const Survey& survey, int64_t pair, int y, const float* weights, float* own,
                  float* map) {
    std::array<const float*, most_planes> inputs;
    for (int i = 0; i < survey.inputs; ++i) {
      float* const copy = own + i * survey.padded;
      std::copy_n(survey.plane_row(pair, i, y), survey.cells, copy);
      std::fill(copy + survey.cells, copy + survey.padded, 0.0f);
      inputs[static_cast<size_t>(i)] = copy;
    }
    compute_row(survey, inputs.data(), survey.inputs, weights, call.floats(weight_input + 1), map_row(survey, map, y));
  }

  static void look_around(const Survey& survey, const float* map, const float* nothing, int y, int distance,
                          const float* weights, const float* bias, float* row) {
    std::array<const float*, taps> inputs;
    const float** next = inputs.data();
    for (int i = 0; i < thin_outputs; ++i) {
      const auto line = [&](int from) {
        const bool inside = from >= 0 && from < survey.rows;
        return (inside ? map + (static_cast<ptrdiff_t>(from) * thin_outputs + i) * survey.row_values() : nothing) + margin;
      };
      next = name_taps(y, distance, line, next);
    }
    compute_row(survey, inputs.data(), taps, weights, bias, row);
  }

  static void add_up(const FunctionCall& call, const Survey& survey, int64_t pair, int y, const float* row, float* scale) {
    const float* weights = call.floats(sum_input);
    std::fill_n(scale, survey.cells, weights[0]);
    for (int i = 0; i < survey.evidence + thin_outputs; ++i) {
      const int output = i - survey.evidence;
      const float* values = output < 0 ? survey.plane_row(pair, i, y) : row + output * survey.row_values() + margin;
      const float weight = weights[1 + i];
      for (int x = 0; x < survey.cells; ++x) scale[x] += weight * values[x];
    }
    for (int x = 0; x < survey.cells; ++x) scale[x] = std::clamp(scale[x], -largest_log, largest_log);
  }

  Scratch scratch_;
  Scratch row_scratch_;
};

}  // namespace

std::unique_ptr<Function> make_scale_of_errors(const FunctionSettings&) { return std::make_unique<ScaleOfErrors>(); }

}  // namespace endosdk
