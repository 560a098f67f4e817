// Parts of layers with few outputs, which functions compute by `ThinRow`.
#pragma once

#include <algorithm>

#include "kernels/kernels.hpp"

namespace endosdk {

constexpr int thin_window = 3;  // taps of a layer along each axis
constexpr int thin_taps = thin_window * thin_window;

// Number of values that a row of cells must have behind its first cell.
inline int padded_cells(int cells) { return (cells + thin_width - 1) / thin_width * thin_width; }

// Writes the weights [output, input] of a layer as `ThinRow` takes them. Returns the first place behind them.
inline float* turn_weights(const float* weights, int inputs, int outputs, float* turned) {
  for (int i = 0; i < inputs; ++i) {
    for (int o = 0; o < outputs; ++o) *turned++ = weights[o * inputs + i];
  }
  return turned;
}

// Names the taps of one input of a layer: `line(j)` is its row j, at the first cell.
template <typename Line>
const float** name_taps(int y, int distance, const Line& line, const float** taps) {
  for (int down = -1; down <= 1; ++down) {
    const float* const row = line(y + down * distance);
    for (int along = -1; along <= 1; ++along) *taps++ = row + along * distance;
  }
  return taps;
}

}  // namespace endosdk
