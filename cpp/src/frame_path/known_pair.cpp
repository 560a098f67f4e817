#include "frame_path/known_pair.hpp"

namespace endosdk {
namespace {

constexpr int rows_off = 4;
constexpr double baseline_mm = 4.0;

// A reproducible value of 0 to 255 for each lattice point.
int lattice(uint32_t x, uint32_t y, uint32_t channel) {
  uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ channel * 0xc2b2ae3du;
  h = (h ^ h >> 15) * 0x2c1b3c6du;
  h = (h ^ h >> 12) * 0x297a2d39u;
  return static_cast<int>((h ^ h >> 15) & 255u);
}

// Interpolates between the points of a lattice with this cell size. It uses whole numbers, so that every machine makes the same
// picture.
int blotch(int x, int y, int cell, int channel) {
  const auto at = [&](int i, int j) {
    return lattice(static_cast<uint32_t>(x / cell + i), static_cast<uint32_t>(y / cell + j),
                   static_cast<uint32_t>(channel + 4 * cell));
  };
  const int u = x % cell;
  const int v = y % cell;
  const int upper = at(0, 0) * (cell - u) + at(1, 0) * u;
  const int lower = at(0, 1) * (cell - u) + at(1, 1) * u;
  return (upper * (cell - v) + lower * v) / (cell * cell);
}

// A picture of a plane that faces the cameras, with a texture like tissue: blotches over fine grain. Its first pixel shows
// point (first_x, first_y) of the plane.
std::vector<uint8_t> picture_of_plane(Size size, int first_x, int first_y) {
  std::vector<uint8_t> pixels;
  pixels.reserve(rgb_bytes(size));
  for (int y = first_y; y < first_y + size.height; ++y) {
    for (int x = first_x; x < first_x + size.width; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        const int value = 2 * blotch(x, y, 4, channel) + blotch(x, y, 11, channel) + blotch(x, y, 41, channel);
        pixels.push_back(static_cast<uint8_t>((channel == 0 ? 60 : 20) + value * 40 / 256));
      }
    }
  }
  return pixels;
}

// Both cameras look straight ahead. Their focal length is the width.
Rig rig_for(Size size) {
  endo_calibration numbers{};
  numbers.struct_size = sizeof numbers;
  numbers.width = size.width;
  numbers.height = size.height;
  for (double* matrix : {numbers.left_matrix, numbers.right_matrix}) {
    matrix[0] = matrix[4] = size.width;
    matrix[2] = 0.5 * (size.width - 1);
    matrix[5] = 0.5 * (size.height - 1);
    matrix[8] = 1.0;
  }
  numbers.right_matrix[5] += rows_off;
  numbers.rotation[0] = numbers.rotation[4] = numbers.rotation[8] = 1.0;
  numbers.translation[0] = -baseline_mm;
  return Rig(numbers);
}

ImageView view_of(const std::vector<uint8_t>& pixels, Size size) {
  return {pixels.data(), size.width, size.height, 3, ptrdiff_t{3} * size.width};
}

}  // namespace

KnownPair::KnownPair(Size size, int shift)
    : rig_(rig_for(size)),
      depth_mm_(size.width * baseline_mm / shift),
      left_(picture_of_plane(size, 0, rows_off)),
      right_(picture_of_plane(size, shift, 0)) {}

FramePair KnownPair::frames() const { return {view_of(left_, size()), view_of(right_, size()), ChannelOrder::rgb}; }

double KnownPair::disparity_px(double depth_mm) const {
  const RectifiedGeometry& g = rig_.geometry();
  return g.focal_px() * baseline_mm / depth_mm - g.doffs();
}

}  // namespace endosdk
