// How surfaces change their disparity from one frame to the next, separated from errors that change.
//
// A change that the whole picture shares comes from the motion of the camera. It is fitted and followed as a rate, because a
// camera keeps moving. A further change that a neighbourhood shares comes from a tool that moves by itself.
#pragma once

#include <array>
#include <vector>

#include "images/resize.hpp"
#include "images/size.hpp"

namespace endosdk {

// Differences of disparity, in units of the expected error. Up to `agreeing` the previous disparity counts in full. From
// `disagreeing` on it does not count. Both are wide: where the pictures agree, most of a difference is an error of the network.
constexpr float agreeing = 8.0f, disagreeing = 16.0f;

// Maps of one size, in network pixels.
struct ChangingMaps {
  FloatView now;    // unfiltered disparity of the current frame
  FloatView gate;   // how well the pictures agree, 0..1
  FloatView error;  // expected error of `now`
};

// The changes that one camera sees. It takes every frame in order, and keeps its memory.
class DisparityChange {
 public:
  // Forgets the earlier frames.
  void begin_anew() { rate_ = {}; }

  // Adds the change to `moved`, which holds the previous disparities at the places where their surfaces are now.
  void follow(const ChangingMaps& maps, MutableFloatView moved);

 private:
  static constexpr int terms = 5;
  using Terms = std::array<float, terms>;
  using Matrix = std::array<std::array<double, terms + 1>, terms>;

  // Weighted sums over a block of cells.
  struct Block {
    float weight = 0.0f, difference = 0.0f, error = 0.0f, moved = 0.0f, x = 0.0f, y = 0.0f;
  };
  // One block in the fit.
  struct Sample {
    Terms values;
    float difference, weight;
  };

  static Terms terms_of(float disparity, float x, float y);
  static float sum(const Terms& weights, const Terms& values);
  static Terms solve(Matrix& system);

  void sum_blocks(const ChangingMaps& maps, const FloatView& moved);
  void follow_camera(MutableFloatView moved);
  Terms fitted_change();
  float mean_square(const Terms& change) const;
  void follow_tools(MutableFloatView moved);
  Block sums_around(int x, int y) const;
  float median_size(const std::vector<float>& values);

  Terms rate_{};  // the camera's change per frame
  Size grid_;     // blocks along and down
  std::vector<Block> blocks_;
  std::vector<Sample> samples_;
  std::vector<float> left_over_;  // residual of the fit, per sample
  std::vector<float> changes_;    // change of the neighbourhood, per block
  std::vector<float> sorted_;
};

}  // namespace endosdk
