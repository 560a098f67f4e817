// What the confidence reads besides its evidence: how far the refinement moved the answer, the hints that it had, and how the
// disparity jumps around.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "functions/extremes.hpp"
#include "functions/function.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr int side = 2;  // pixels of the answer along a side of a cell
constexpr int per_cell = side * side;
constexpr int hint_planes = 24;
constexpr int disparity_hint = 15;  // its place takes the disparity in another unit, and what lies around
constexpr int around_planes = 4;
constexpr int clue_planes = hint_planes - 1 + around_planes;
constexpr int doubt_planes = 2;
constexpr int near_reach = 2;  // cells
constexpr int wide_reach = 6;
constexpr float least_change = 0.05f;  // px
constexpr float least_jump = 0.02f;    // units of the disparity

// One view pair of a batch.
struct Pair {
  const float* hints;
  const float* disparity;
  const float* correction;
  const float* change;
  float* doubts;
  float* clues;
  float share;  // of a pixel in a unit of the disparity
  int rows;
  int cells;

  int64_t plane() const { return int64_t{rows} * cells; }

  static size_t scratch_values(int cells) { return static_cast<size_t>(ExtremesRow::scratch_values(cells) + 2 * cells); }

  void find_doubts(int y, float* scratch) const;
  void find_clues(int y, float* scratch) const;
};

void Pair::find_doubts(int y, float* scratch) const {
  const int64_t first = int64_t{y} * cells;
  float* largest = scratch;
  for (int x = 0; x < cells; ++x) largest[x] = std::fabs(correction[first + x]);
  for (int part = 1; part < per_cell; ++part) {
    const float* moved = correction + part * plane() + first;
    for (int x = 0; x < cells; ++x) largest[x] = std::max(largest[x], std::fabs(moved[x]));
  }
  kernels().log_row(largest, 1.0f, least_change, cells, doubts + first);
  const float* upper = change + side * side * first;
  const float* lower = upper + side * cells;
  for (int x = 0; x < cells; ++x) {
    const float above = std::max(std::fabs(upper[2 * x]), std::fabs(upper[2 * x + 1]));
    const float below = std::max(std::fabs(lower[2 * x]), std::fabs(lower[2 * x + 1]));
    largest[x] = std::max(above, below);
  }
  kernels().log_row(largest, 1.0f, least_change, cells, doubts + plane() + first);
}

void Pair::find_clues(int y, float* scratch) const {
  const int64_t first = int64_t{y} * cells;
  const size_t row_bytes = sizeof(float) * static_cast<size_t>(cells);
  for (int i = 0; i < disparity_hint; ++i) std::memcpy(clues + i * plane() + first, hints + i * plane() + first, row_bytes);
  for (int i = disparity_hint + 1; i < hint_planes; ++i) {
    std::memcpy(clues + (i - 1 + around_planes) * plane() + first, hints + i * plane() + first, row_bytes);
  }
  const float* here = disparity + first;
  float* own = clues + disparity_hint * plane() + first;
  float* in_front = own + plane();
  float* most = scratch;
  float* least = scratch + cells;
  float* rest = least + cells;
  find_extremes(disparity, rows, cells, y, near_reach, rest, most, least);
  for (int x = 0; x < cells; ++x) {
    own[x] = here[x] * share;
    in_front[x] = (most[x] - here[x]) * share;
  }
  for (int i = 0; i < 2; ++i) {
    if (i == 1) find_extremes(disparity, rows, cells, y, wide_reach, rest, most, least);
    for (int x = 0; x < cells; ++x) most[x] -= least[x];
    kernels().log_row(most, share, least_jump, cells, in_front + (i + 1) * plane());
  }
}

class CluesOfAnswer : public Function {
 public:
  explicit CluesOfAnswer(float share) : share_(share) {}

  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(1);
    check_shape("disparity", shape, {-1, 1, -1, -1});
    const int64_t count = shape[0];
    const int rows = static_cast<int>(shape[2]);
    const int cells = static_cast<int>(shape[3]);
    check_shape("hints", call.shape(0), {count, hint_planes, rows, cells});
    check_shape("correction", call.shape(2), {count, per_cell, rows, cells});
    check_shape("change", call.shape(3), {count, 1, int64_t{side} * rows, int64_t{side} * cells});
    float* doubts = call.float_output(0, {count, doubt_planes, rows, cells});
    float* clues = call.float_output(1, {count, clue_planes, rows, cells});
    if (cells == 0) return;
    const int64_t plane = int64_t{rows} * cells;
    for (int64_t i = 0; i < count; ++i) {
      const Pair pair = {call.floats(0) + i * hint_planes * plane, call.floats(1) + i * plane, call.floats(2) + i * per_cell * plane,
                         call.floats(3) + i * per_cell * plane,    doubts + i * doubt_planes * plane,
                         clues + i * clue_planes * plane,          share_, rows, cells};
      for_each_row(call, scratch_, rows, Pair::scratch_values(cells), [&](int y, float* own) {
        pair.find_doubts(y, own);
        pair.find_clues(y, own);
      });
    }
  }

 private:
  float share_;
  Scratch scratch_;
};

}  // namespace

std::unique_ptr<Function> make_clues_of_answer(const FunctionSettings& settings) {
  return std::make_unique<CluesOfAnswer>(1.0f / positive_setting(settings, "unit"));
}

}  // namespace endosdk
