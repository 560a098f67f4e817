// Measures that separate noise from texture in one view. The file is compiled once per instruction set. Sums have a fixed
// order, so that every set rounds alike.
#include <string.h>

#include "kernels/kernels.hpp"
#include "kernels/sets.hpp"

namespace endosdk::ENDOSDK_ISA {
namespace {

typedef float Floats __attribute__((vector_size(tile_cells * sizeof(float))));

constexpr int chunk = 128;

float sum_of(const Floats& values) {
  float sum = 0.0f;
  for (int i = 0; i < tile_cells; ++i) sum += values[i];
  return sum;
}

}  // namespace

void noise_row(const uint8_t* above, const uint8_t* here, const uint8_t* below, int count, uint16_t* __restrict out) {
  int16_t down[chunk + 2];  // second differences across the rows
  for (int first = 0; first + 2 < count; first += chunk) {
    const int wanted = count - 2 - first < chunk ? count - 2 - first : chunk;
    for (int i = 0; i < wanted + 2; ++i) {
      down[i] = static_cast<int16_t>(above[first + i] + below[first + i] - 2 * here[first + i]);
    }
    for (int i = 0; i < wanted; ++i) {
      const auto mixed = static_cast<int16_t>(down[i] + down[i + 2] - 2 * down[i + 1]);
      out[first + i + 1] = static_cast<uint16_t>(mixed < 0 ? -mixed : mixed);
    }
  }
}

void tile_row(const TileRow& row) {
  constexpr float count = tile_cells * tile_cells;
  constexpr float spread = (tile_cells * tile_cells - 1) / 12.0f;  // variance of the positions along one axis
  constexpr float middle = 0.5f * (tile_cells - 1);
  Floats place;
  for (int x = 0; x < tile_cells; ++x) place[x] = static_cast<float>(x) - middle;
  for (int t = 0; t < row.tiles; ++t) {
    const float* levels = row.levels + t * tile_cells;
    const float base = levels[0];
    Floats sums = {}, squares = {}, down = {};
    for (int y = 0; y < tile_cells; ++y, levels += row.stride) {
      Floats value;
      memcpy(&value, levels, sizeof(value));
      value -= base;
      sums += value;
      squares += value * value;
      down += value * (static_cast<float>(y) - middle);
    }
    const float mean = sum_of(sums) / count;
    const float slope_along = sum_of(sums * place);
    const float slope_down = sum_of(down);
    row.roughness[t] = sum_of(squares) / count - mean * mean - (slope_along * slope_along + slope_down * slope_down) / (count * count * spread);
  }
}

}  // namespace endosdk::ENDOSDK_ISA
