#include "frame_path/network_size.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

constexpr int largest_width = 960;
constexpr int reduced_width = 720;

}  // namespace

Size network_size_of(Size frame, int inference_width) {
  if (inference_width <= 0 && frame.width <= largest_width) return frame;
  const int width = inference_width > 0 ? inference_width : reduced_width;
  if (frame.width == width) return frame;
  const double height = static_cast<double>(frame.height) * width / frame.width;
  return {width, std::max(1, static_cast<int>(std::lround(height)))};
}

}  // namespace endosdk
