#include "network_size.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

constexpr int trained_width = 960;
constexpr int reduced_width = 720;

}  // namespace

Size usual_network_size(Size frame) {
  if (frame.width <= trained_width) return frame;
  const double height = static_cast<double>(frame.height) * reduced_width / frame.width;
  return {reduced_width, std::max(1, static_cast<int>(std::lround(height)))};
}

}  // namespace endosdk
