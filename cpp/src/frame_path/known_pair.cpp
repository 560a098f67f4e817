#include "frame_path/known_pair.hpp"

#include <algorithm>
#include <utility>

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

// The colour of a surface: what is added to its texture, and the texture's contrast in 256ths.
struct Paint {
  int base[3];
  int contrast;
};

constexpr Paint tissue = {{60, 20, 20}, 40};

// A picture of surfaces that face the cameras, with a texture like tissue: blotches over fine grain. Its first row shows row
// `first_row` of the surfaces. `shift_of(row)` is the place of the first column there, and `paint_of(column)` the paint.
template <typename ShiftOf, typename PaintOf>
std::vector<uint8_t> picture_of(Size size, int first_row, const ShiftOf& shift_of, const PaintOf& paint_of) {
  std::vector<uint8_t> pixels;
  pixels.reserve(rgb_bytes(size));
  for (int y = first_row; y < first_row + size.height; ++y) {
    const int first = shift_of(y);
    for (int x = first; x < first + size.width; ++x) {
      const Paint& paint = paint_of(x);
      for (int channel = 0; channel < 3; ++channel) {
        const int value = 2 * blotch(x, y, 4, channel) + blotch(x, y, 11, channel) + blotch(x, y, 41, channel);
        pixels.push_back(static_cast<uint8_t>(paint.base[channel] + value * paint.contrast / 256));
      }
    }
  }
  return pixels;
}

std::vector<uint8_t> picture_of_plane(Size size, int first_row, int shift) {
  return picture_of(size, first_row, [&](int) { return shift; }, [](int) -> const Paint& { return tissue; });
}

// Bands of equal height, from the far one at the top to the near one at the bottom, in stripes of unlike colour and contrast.
std::vector<uint8_t> picture_of_bands(Size size, int first_row, int far_px, int near_px) {
  constexpr int bands = 8;
  constexpr int stripe_px = 64;
  static constexpr Paint paints[] = {tissue, {{100, 60, 50}, 20}, {{10, 10, 15}, 60}, {{90, 100, 60}, 30}};
  const auto shift_of = [&](int row) {
    const int band = std::min(bands - 1, row * bands / (size.height + rows_off));
    return far_px + (near_px - far_px) * band / (bands - 1);
  };
  return picture_of(size, first_row, shift_of, [](int column) -> const Paint& { return paints[column / stripe_px % 4]; });
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

KnownPair KnownPair::plane(Size size, int shift) {
  return {size, picture_of_plane(size, rows_off, 0), picture_of_plane(size, 0, shift)};
}

KnownPair KnownPair::bands(Size size, int far_px, int near_px) {
  return {size, picture_of_bands(size, rows_off, 0, 0), picture_of_bands(size, 0, far_px, near_px)};
}

KnownPair::KnownPair(Size size, std::vector<uint8_t> left, std::vector<uint8_t> right)
    : rig_(rig_for(size)), left_(std::move(left)), right_(std::move(right)) {}

FramePair KnownPair::frames() const { return {view_of(left_, size()), view_of(right_, size()), ChannelOrder::rgb}; }

double KnownPair::depth_mm(double shift) const { return size().width * baseline_mm / shift; }

double KnownPair::disparity_px(double depth_mm) const {
  const RectifiedGeometry& g = rig_.geometry();
  return g.focal_px() * baseline_mm / depth_mm - g.doffs();
}

}  // namespace endosdk
