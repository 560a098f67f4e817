// How surfaces change their disparity from one frame to the next, told apart from errors that change.
//
// What the whole picture shares is the camera's motion. It is fitted, and followed as a rate: a camera moves on. What a
// neighbourhood shares beside it is a tool that moves by itself.
#pragma once

#include <array>
#include <vector>

#include "images/resize.hpp"
#include "images/size.hpp"

namespace endosdk {

// Differences of disparity, in units of the error to be expected, up to which what was before counts in full, and from which on
// it does not count. They are wide: where the pictures agree, most of what differs is an error of the network.
constexpr float agreeing = 8.0f, disagreeing = 16.0f;

// Maps of one size, in network pixels.
struct ChangingMaps {
  FloatView now;    // the frame's own disparity
  FloatView gate;   // 0..1: how far the pictures agree
  FloatView error;  // to be expected of the frame's own disparity
};

// Of one camera, frame after frame. Keeps its memory.
class DisparityChange {
 public:
  // Where nothing is known of the frames before.
  void begin_anew() { rate_ = {}; }

  // Adds the change to disparities of the frame before that were moved to where their surfaces are now.
  void follow(const ChangingMaps& maps, MutableFloatView moved);

 private:
  static constexpr int terms = 5;
  using Terms = std::array<float, terms>;
  using Matrix = std::array<std::array<double, terms + 1>, terms>;

  // Sums over a block of cells, each by its weight.
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
  void follow_tools(MutableFloatView moved);
  Block sums_around(int x, int y) const;
  float median_size(const std::vector<float>& values);

  Terms rate_{};  // of the camera's change, per frame
  Size grid_;     // of blocks
  std::vector<Block> blocks_;
  std::vector<Sample> samples_;
  std::vector<float> left_over_;  // of the fit, per sample
  std::vector<float> changes_;    // of neighbourhoods, per block
  std::vector<float> limits_;     // of noise, per block
  std::vector<float> sorted_;
};

}  // namespace endosdk
