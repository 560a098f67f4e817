// Rows of what networks make of the comparison: volume, answer and confidence. The file is compiled once per instruction set.
#include "kernels/kernels.hpp"
#include "kernels/maths.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

constexpr int choose_width = 64;  // cells at a time, in choose_row and confidence_row

float sigmoid(float x) { return 1.0f / (1.0f + exp_of(-x)); }

// The disparity of the left or the right pixel of each cell, and the value to add to it. They are separate from the maps,
// because the compiler knows that a few arrays on the stack do not overlap.
struct Chosen {
  float before[choose_width];
  float added[choose_width];
};

// Computes `width` cells of a thin layer. They are few enough for their sums to stay in registers.
template <int outputs, int width>
void thin_cells(const ThinRow& row, int first) {
  float sum[outputs][width];
  for (int o = 0; o < outputs; ++o) {
    for (int x = 0; x < width; ++x) sum[o][x] = row.bias[o];
  }
  for (int i = 0; i < row.count; ++i) {
    const float* const input = row.inputs[i] + first;
    const float* const weights = row.weights + outputs * i;
    for (int o = 0; o < outputs; ++o) {
      for (int x = 0; x < width; ++x) sum[o][x] += weights[o] * input[x];
    }
  }
  const int count = row.cells - first < width ? row.cells - first : width;
  for (int o = 0; o < outputs; ++o) {
    float* const out = row.out + o * row.out_stride + first;
    for (int x = 0; x < count; ++x) out[x] = at_least(sum[o][x], row.least);
  }
}

// Brings two rows of cells to a row of the grid of twice the size, with one more value at both ends.
void mix_rows(const float* nearer, const float* other, int cells, float* mixed) {
  for (int x = 0; x < cells; ++x) mixed[x] = 0.75f * nearer[x] + 0.25f * other[x];
  mixed[-1] = mixed[0];
  mixed[cells] = mixed[cells - 1];
}

void choose_pixels(const ChooseRow& row, int first, int count, int part, Chosen& chosen) {
  const float* const own = row.mixed + first;
  const float* const beside = part == 0 ? own - 1 : own + 1;
  const float* const correction = row.correction[part] + first;
  const float* const belief = row.belief[part] + first;
  const float* const step = row.step[part] + first;
  for (int x = 0; x < count; ++x) {
    chosen.before[x] = 0.75f * own[x] + 0.25f * beside[x];
    chosen.added[x] = correction[x] + sigmoid(belief[x]) * step[x];
  }
  const auto move_to = [&](const float* surface, const float* gate) {
    for (int x = 0; x < count; ++x) chosen.added[x] += sigmoid(gate[first + x]) * (surface[first + x] - chosen.before[x]);
  };
  move_to(row.near, row.to_near[part]);
  move_to(row.far, row.to_far[part]);
}

}  // namespace

void soft_argmin_cells(const SoftArgminCells& cells) {
  constexpr int width = soft_argmin_width;
  float least[width];
  float likeliest[width];
  for (int x = 0; x < width; ++x) least[x] = cells.cost[x];
  for (int x = 0; x < width; ++x) likeliest[x] = cells.index[0];
  for (int p = 1; p < cells.planes; ++p) {
    const float* const cost = cells.cost + p * width;
    const float index = cells.index[p];
    for (int x = 0; x < width; ++x) likeliest[x] = cost[x] < least[x] ? index : likeliest[x];
    for (int x = 0; x < width; ++x) least[x] = at_most(cost[x], least[x]);
  }
  float total[width] = {};
  float first[width] = {};
  float second[width] = {};
  float near_total[width] = {};
  float near_first[width] = {};
  for (int p = 0; p < cells.planes; ++p) {
    const float* const cost = cells.cost + p * width;
    const float index = cells.index[p];
    const float value = cells.value[p];
    const float square = value * value;
    for (int x = 0; x < width; ++x) {
      const float weight = exp_of(least[x] - cost[x]);
      const float apart = index - likeliest[x];
      const float near = apart <= cells.reach && -apart <= cells.reach ? weight : 0.0f;
      total[x] += weight;
      first[x] += value * weight;
      second[x] += square * weight;
      near_total[x] += near;
      near_first[x] += value * near;
    }
  }
  const float dense = cells.dense;
  const float sparse_gap = cells.gap;
  for (int x = 0; x < width; ++x) {
    const float mean = first[x] / total[x];
    const float gap = mean < dense ? 1.0f : sparse_gap;
    constexpr float far = 65536.0f;  // beyond all planes
    const float place = at_least(at_most((mean - dense) / gap, far), -far);
    // Computes the floor with integers; they can hold all places.
    const auto whole = static_cast<float>(static_cast<int32_t>(place));
    const float fraction = place - (whole - (whole > place ? 1.0f : 0.0f));
    const float excess = second[x] / total[x] - mean * mean - fraction * (1.0f - fraction) * gap * gap;
    cells.mean[x] = near_first[x] / near_total[x];
    cells.excess[x] = at_least(excess, 0.0f);
  }
}

void choose_row(const ChooseRow& row) {
  mix_rows(row.disparity, row.beside, row.cells, row.mixed);
  Chosen left;
  Chosen right;
  for (int first = 0; first < row.cells; first += choose_width) {
    const int count = row.cells - first < choose_width ? row.cells - first : choose_width;
    choose_pixels(row, first, count, 0, left);
    choose_pixels(row, first, count, 1, right);
    float* const rough = row.rough + 2 * first;
    float* const change = row.change + 2 * first;
    float* const answer = row.answer + 2 * first;
    for (int x = 0; x < count; ++x) {
      rough[2 * x] = left.before[x];
      rough[2 * x + 1] = right.before[x];
    }
    for (int x = 0; x < count; ++x) {
      change[2 * x] = left.added[x];
      change[2 * x + 1] = right.added[x];
    }
    for (int x = 0; x < count; ++x) {
      answer[2 * x] = at_least(left.before[x] + left.added[x], 0.0f);
      answer[2 * x + 1] = at_least(right.before[x] + right.added[x], 0.0f);
    }
  }
}

void thin_row(const ThinRow& row) {
  const auto compute = row.outputs == 4 ? thin_cells<4, 2 * thin_width> : thin_cells<8, thin_width>;
  const int width = row.outputs == 4 ? 2 * thin_width : thin_width;
  int first = 0;
  for (; first + width <= row.cells; first += width) compute(row, first);
  const auto rest = row.outputs == 4 ? thin_cells<4, thin_width> : thin_cells<8, thin_width>;
  for (; first < row.cells; first += thin_width) rest(row, first);
}

void add_bytes(const uint8_t* a, const uint8_t* b, const SumOfBytes& steps, int count, uint8_t* __restrict out) {
  const SumOfBytes own = steps;
  constexpr float to_whole = 12582912.0f;  // 1.5 * 2^23: adding it rounds to whole numbers, half to even
  for (int i = 0; i < count; ++i) {
    const float sum = own.first * static_cast<float>(a[i]) + own.second * static_cast<float>(b[i]) + own.constant;
    const float within = at_most(at_least(sum, own.least), 255.0f);
    out[i] = static_cast<uint8_t>(static_cast<int32_t>((within + to_whole) - to_whole));
  }
}

void confidence_row(const ConfidenceRow& row) {
  mix_rows(row.scale, row.beside, row.cells, row.mixed);
  const auto confidence = [](float log_scale) { return 1.0f - exp_of(-exp_of(-log_scale)); };
  float left[choose_width];
  float right[choose_width];
  for (int first = 0; first < row.cells; first += choose_width) {
    const int count = row.cells - first < choose_width ? row.cells - first : choose_width;
    const float* const mixed = row.mixed + first;
    for (int x = 0; x < count; ++x) left[x] = confidence(0.75f * mixed[x] + 0.25f * mixed[x - 1]);
    for (int x = 0; x < count; ++x) right[x] = confidence(0.75f * mixed[x] + 0.25f * mixed[x + 1]);
    float* const out = row.out + 2 * first;
    for (int x = 0; x < count; ++x) {
      out[2 * x] = left[x];
      out[2 * x + 1] = right[x];
    }
  }
}

void log_row(const float* values, float share, float added, int count, float* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = log_of(share * values[x] + added);
}

}  // namespace endosdk::ENDOSDK_ISA
