// Runs every kernel, in every instruction set, on buffers of exactly the size that it may touch. With the address sanitizer, an
// access outside fails. Without it, the test still compares the sets with each other.
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "check.hpp"
#include "images/image.hpp"
#include "kernels/kernels.hpp"
#include "maps/postprocess.hpp"
#include "images/rectify.hpp"
#include "images/resize.hpp"
#include "platform/threads.hpp"

using namespace endosdk;

namespace {

std::vector<const char*> available_sets() {
  std::vector<const char*> names;
  for (const char* name : {"plain", "avx2", "avx512", "neon"}) {
    if (rejection([&] { choose_kernels(name); }).empty()) names.push_back(name);
  }
  return names;
}

// Heap memory with nothing readable before or after it, filled with a repeatable pattern.
struct Bytes {
  explicit Bytes(size_t count, unsigned seed = 1) : size(count), data(new uint8_t[count]) {
    for (size_t i = 0; i < count; ++i) data[i] = static_cast<uint8_t>((seed = seed * 1664525u + 1013904223u) >> 24);
  }
  bool operator==(const Bytes& other) const { return std::memcmp(data.get(), other.data.get(), size) == 0; }

  size_t size;
  std::unique_ptr<uint8_t[]> data;
};

ViewGeometry view(int width, int height, double angle) {
  ViewGeometry v;
  v.camera = {CameraModel::pinhole, 1.1 * width, 1.1 * width, 0.5 * width, 0.5 * height, {-0.2, 0.05, 1e-3, -1e-3}};
  v.rotation = rotation_matrix({0.02, -0.01, angle});
  v.projection = {1.0 * width, 0, 0.5 * width, 0, 0, 1.0 * width, 0.5 * height, 0, 0, 0, 1, 0};
  return v;
}

// The last row of a strided image ends with its last pixel. The memory after it does not belong to the image.
ImageView strided(const Bytes& memory, int width, int height, int channels, int gap) {
  const ptrdiff_t stride = width * channels + gap;
  CHECK(memory.size == static_cast<size_t>(stride * (height - 1) + width * channels));
  return {memory.data.get(), width, height, channels, stride};
}

void test_rectify(int width, int height, int gap, ChannelOrder order) {
  const int channels = order == ChannelOrder::gray ? 1 : 3;
  const Bytes frame(static_cast<size_t>((width * channels + gap) * (height - 1) + width * channels), 7);
  const ImageView image = strided(frame, width, height, channels, gap);
  const ImageView flipped = {image.row(height - 1), width, height, channels, -image.stride};
  const Rectifier rectifier({width, height}, {width, height}, view(width, height, 0.05), view(width, height, -0.3),
                            Border::fading);
  const size_t planes = static_cast<size_t>(3 * (width + 5) * (height + 2));
  choose_kernels("plain");
  Bytes expected_left(planes), expected_right(planes);
  const auto planar = [&](Bytes& b) { return PlanarView{b.data.get(), width + 5, height + 2}; };
  RectifyScratch scratch;
  rectifier.rectify(image, flipped, planar(expected_left), planar(expected_right), order, scratch);
  for (const char* name : available_sets()) {
    choose_kernels(name);
    Bytes left(planes, 3), right(planes, 4);
    rectifier.rectify(image, flipped, planar(left), planar(right), order, scratch);
    CHECK(left == expected_left);
    CHECK(right == expected_right);
    pack(image, flipped, planar(left), planar(right), order);
  }
}

template <typename Value>
std::unique_ptr<Value[]> exactly(int count, Value value) {
  std::unique_ptr<Value[]> memory(new Value[static_cast<size_t>(count)]);
  for (int i = 0; i < count; ++i) memory[static_cast<size_t>(i)] = value;
  return memory;
}

void test_postprocess(int h, int w, int height, int width) {
  auto disparity = exactly(h * w, 5.0f);
  auto confidence = exactly(h * w, 0.9f);
  disparity[0] = std::numeric_limits<float>::quiet_NaN();
  disparity[static_cast<size_t>(h * w - 1)] = std::numeric_limits<float>::infinity();
  const Bytes left(static_cast<size_t>(3 * height * width));
  const auto valid = exactly<uint8_t>(height * width, 1);
  valid[static_cast<size_t>(width / 2)] = 0;
  PostprocessInput in;
  in.size = {width, height};
  in.disparity = {disparity.get(), w, h};
  in.confidence = {confidence.get(), w, h};
  in.scale = {static_cast<double>(h) / height, static_cast<double>(w) / width};
  in.gain = static_cast<float>(width) / static_cast<float>(w);
  in.left = {left.data.get(), width, height};
  in.valid_left = in.valid_right = valid.get();
  in.geometry = {500.0, 4.0, 0.5, 0.0, std::numeric_limits<double>::infinity()};
  for (const char* name : available_sets()) {
    choose_kernels(name);
    const auto d = exactly(height * width, 0.0f), c = exactly(height * width, 0.0f);
    const auto depth = exactly(height * width, 0.0f), sigma = exactly(height * width, 0.0f);
    const auto reasons = exactly<uint8_t>(height * width, 0);
    MapsOut out;
    out.disparity = d.get();
    out.confidence = c.get();
    out.reasons = reasons.get();
    out.depth = depth.get();
    out.sigma = sigma.get();
    PostprocessScratch scratch;
    const int usable = postprocess(in, out, scratch);
    int counted = 0;
    for (int i = 0; i < height * width; ++i) {
      const size_t at = static_cast<size_t>(i);
      counted += reasons[at] == 0;
      CHECK(std::isnan(depth[at]) == (reasons[at] != 0));
      CHECK(std::isnan(sigma[at]) == (reasons[at] != 0));
    }
    CHECK(usable == counted);
  }
}

}  // namespace

int main() {
  for (const int threads : {1, 3}) {
    set_thread_count(threads);
    for (const ChannelOrder order : {ChannelOrder::rgb, ChannelOrder::bgr, ChannelOrder::gray}) {
      for (const int gap : {0, 1, 13}) {
        for (const int width : {1, 2, 3, 5, 8, 15, 16, 17, 31, 64, 97}) test_rectify(width, 19, gap, order);
        test_rectify(40, 1, gap, order);
      }
    }
    for (const int width : {1, 3, 8, 127, 128, 129, 300}) {
      test_postprocess(3, (width + 7) / 8, 17, width);
      test_postprocess(17, width, 17, width);
      test_postprocess(40, 2 * width, 17, width);  // a map that shrinks
      for (const int factor : {2, 3}) test_postprocess(7, width, 7 * factor, width * factor);  // guided by the view
    }
  }
  const FloatView nothing = {nullptr, 0, 0};
  CHECK(rejection([&] { resize_bilinear(nothing, {nullptr, 1, 1}, {1, 1}, 1); }) == "src: must not be empty; got 0x0");
  CHECK(!rejection([] { choose_kernels("mmx"); }).empty());
  return 0;
}
