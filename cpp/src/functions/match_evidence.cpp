// What betrays a bad match: the doubt of the distribution over planes, and a jump of the disparity nearby.
#include "functions/extremes.hpp"
#include "functions/function.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr int evidence_planes = 2;
constexpr int reach = 1;  // cells
constexpr float least_excess = 1e-3f;
constexpr float least_jump = 0.1f;  // px

class MatchEvidence : public Function {
 public:
  explicit MatchEvidence(float cell) : cell_(cell) {}

  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(0);
    check_shape("disparity", shape, {-1, 1, -1, -1});
    check_shape("excess", call.shape(1), shape);
    const int rows = static_cast<int>(shape[2]);
    const int cells = static_cast<int>(shape[3]);
    float* evidence = call.float_output(0, {shape[0], evidence_planes, rows, cells});
    if (cells == 0) return;
    const int64_t plane = int64_t{rows} * cells;
    const auto row_values = static_cast<size_t>(ExtremesRow::scratch_values(cells) + 2 * cells);
    for (int64_t i = 0; i < shape[0]; ++i) {
      const float* disparity = call.floats(0) + i * plane;
      const float* excess = call.floats(1) + i * plane;
      float* doubt = evidence + i * evidence_planes * plane;
      for_each_row(call, scratch_, rows, row_values, [&](int y, float* most) {
        float* least = most + cells;
        const int64_t first = int64_t{y} * cells;
        kernels().log_row(excess + first, 1.0f, least_excess, cells, doubt + first);
        find_extremes(disparity, rows, cells, y, reach, least + cells, most, least);
        for (int x = 0; x < cells; ++x) most[x] -= least[x];
        kernels().log_row(most, cell_, least_jump, cells, doubt + plane + first);
      });
    }
  }

 private:
  float cell_;
  Scratch scratch_;
};

}  // namespace

std::unique_ptr<Function> make_match_evidence(const FunctionSettings& settings) {
  return std::make_unique<MatchEvidence>(positive_setting(settings, "cell"));
}

}  // namespace endosdk
