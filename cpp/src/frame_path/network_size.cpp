#include "frame_path/network_size.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

constexpr int largest_width = 960;
constexpr int reduced_width = 720;

}  // namespace

Size network_size_of(Size frame, int inference_width) {
  const int largest = inference_width > 0 ? inference_width : largest_width;
  if (frame.width <= largest) return frame;
  const int width = inference_width > 0 ? inference_width : reduced_width;
  const double height = static_cast<double>(frame.height) * width / frame.width;
  return {width, std::max(1, static_cast<int>(std::lround(height)))};
}

}  // namespace endosdk
