#include "frame_path/self_test.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "frame_path/rectify_stage.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

void require_answer(bool holds, const char* what, const char* rule, const std::string& seen) {
  require(holds, ENDO_SELF_TEST_FAILED, what, rule, seen);
}

// A reproducible value of 0 to 255 for each lattice point.
int lattice(uint32_t x, uint32_t y, uint32_t channel) {
  uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ channel * 0xc2b2ae3du;
  h = (h ^ h >> 15) * 0x2c1b3c6du;
  h = (h ^ h >> 12) * 0x297a2d39u;
  return static_cast<int>((h ^ h >> 15) & 255u);
}

// The lattice of this cell size, blended between its points; whole numbers, so that every machine sees the same picture.
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

// A plane that faces the cameras, textured like tissue: blotches over fine grain.
std::vector<uint8_t> picture_of_plane(Size size, int shift) {
  std::vector<uint8_t> pixels;
  pixels.reserve(size_t{3} * static_cast<size_t>(size.width) * static_cast<size_t>(size.height));
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        const int value = 2 * blotch(x + shift, y, 4, channel) + blotch(x + shift, y, 11, channel) +
                          blotch(x + shift, y, 41, channel);
        pixels.push_back(static_cast<uint8_t>((channel == 0 ? 60 : 20) + value * 40 / 256));
      }
    }
  }
  return pixels;
}

ImageView view_of(const std::vector<uint8_t>& pixels, Size size) {
  return {pixels.data(), size.width, size.height, 3, ptrdiff_t{3} * size.width};
}

// The map of a rig that needs no rectification moves no pixel, so it must give the very bytes of repacking.
void check_rectifier(const std::vector<uint8_t>& pixels, Size size, const PlanarView& packed) {
  const Rig rig = Rig::identity(size);
  const Rectifier rectifier = rig.rectifier(rig.geometry(), Border::fading);
  std::vector<uint8_t> left(size_t{3} * static_cast<size_t>(packed.width) * static_cast<size_t>(packed.height));
  std::vector<uint8_t> right(left.size());
  const ImageView source = view_of(pixels, size);
  RectifyScratch scratch;
  rectifier.rectify(source, source, {left.data(), packed.width, packed.height}, {right.data(), packed.width, packed.height},
                    ChannelOrder::rgb, scratch);
  require_answer(std::memcmp(left.data(), packed.data, left.size()) == 0, "self test: rectify",
                 "must leave a rectified picture as it is", "other bytes");
}

// Share of the grid's pixels, beyond the band that the right view does not see, whose disparity is right to a pixel.
double share_of_right_pixels(const MutableFloatView& map, int stride, Size picture, int truth) {
  const int right_end = picture.width / stride;
  const int rows = picture.height / stride;
  int right = 0;
  int count = 0;
  for (int y = 0; y < rows; ++y) {
    for (int x = std::min(2 * truth / stride + 1, right_end); x < right_end; ++x) {
      const float found = map.data[static_cast<int64_t>(y) * map.width + x];
      right += std::fabs(found - static_cast<float>(truth)) <= 1.0f;
      ++count;
    }
  }
  return count > 0 ? static_cast<double>(right) / count : 0.0;
}

}  // namespace

void run_self_test(Session& session, Size picture, Work& work) {
  const ModelInfo& model = session.model();
  const int truth = std::max(1, std::min(16, model.max_disparity / 4));
  const std::vector<uint8_t> left = picture_of_plane(picture, 0);
  const std::vector<uint8_t> right = picture_of_plane(picture, truth);
  SessionBuffers buffers(picture, model);
  const std::unique_ptr<Session::Run> run = session.bind(buffers);
  pack(view_of(left, picture), view_of(right, picture), buffers.left(), buffers.right(), ChannelOrder::rgb);
  check_rectifier(left, picture, buffers.left());

  work.run(*run);
  const MutableFloatView map = buffers.disparity();
  const std::vector<float> first(map.data, map.data + static_cast<int64_t>(map.width) * map.height);
  const double share = share_of_right_pixels(map, model.output_stride, picture, truth);
  require_answer(share >= 0.5, "self test: disparity", "at least half of a plane must be right to a pixel",
                 std::to_string(100.0 * share) + " %");
  work.run(*run);
  require_answer(std::memcmp(first.data(), map.data, first.size() * sizeof(float)) == 0, "self test: repetition",
                 "the same pair must give the same answer", "another one");
}

}  // namespace endosdk
