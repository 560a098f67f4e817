#include "network_size.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

constexpr int largest_width = 960;
constexpr int reduced_width = 720;

}  // namespace

Size usual_network_size(Size frame, int usual_width) {
  const int largest = usual_width > 0 ? usual_width : largest_width;
  if (frame.width <= largest) return frame;
  const int width = usual_width > 0 ? usual_width : reduced_width;
  const double height = static_cast<double>(frame.height) * width / frame.width;
  return {width, std::max(1, static_cast<int>(std::lround(height)))};
}

}  // namespace endosdk
