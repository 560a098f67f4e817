// What it costs to say that a pixel lies on a plane: section 3.1 of Bleyer, Rhemann, Rother (BMVC 2011).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace patchmatch {

// The paper's constants; `radius` 17 is its window of 35 x 35.
struct Settings {
  int max_disparity;
  int radius;
  int iterations;
  int threads;
  std::uint64_t seed;
};

inline constexpr float kColourScale = 10.0F;     // gamma of the adaptive weights
inline constexpr float kGradientShare = 0.9F;    // alpha
inline constexpr float kColourLimit = 10.0F;     // tau_col
inline constexpr float kGradientLimit = 2.0F;    // tau_grad
inline constexpr float kWorstCost = (1.0F - kGradientShare) * kColourLimit + kGradientShare * kGradientLimit;

inline constexpr int kLargestSide = 63;  // of a window
inline constexpr int kReadBeyond = 32;   // numbers that may be read, and are not used, after the last of a plane

// A view as planes of floats: red, green, blue, and the horizontal gradient of the gray picture.
struct View {
  View(const std::uint8_t* rgb, int height, int width);
  [[nodiscard]] const float* row(int channel, int y) const {
    return planes[static_cast<std::size_t>(channel)].data() + static_cast<std::ptrdiff_t>(y) * width;
  }
  [[nodiscard]] const float* pixels(int y) const { return packed.data() + 4 * static_cast<std::ptrdiff_t>(y) * width; }
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(height) * static_cast<std::size_t>(width); }
  int height, width;
  std::vector<float> planes[4];
  std::vector<float> packed;  // the same, four numbers a pixel
};

// disparity(x, y) = a x + b y + c
struct Plane {
  float a, b, c;
  bool operator==(const Plane&) const = default;
  [[nodiscard]] float at(int x, int y) const {
    return a * static_cast<float>(x) + b * static_cast<float>(y) + c;
  }
};

// Adaptive weights of one pixel's window: they do not depend on the plane, so they are computed once per pixel.
class Window {
 public:
  explicit Window(int radius);
  void centre(const View& view, int x, int y);
  // Cost of the plane at the centre. `sign` is 1 for the left view (match at x - d), -1 for the right one (x + d).
  // Stops early, with a cost above it, once `limit` is passed.
  [[nodiscard]] float cost(const View& view, const View& other, const Plane& plane, int sign, int max_disparity,
                           float limit) const;

  int left, right, top, bottom;  // inclusive, cut at the picture
  int middle;                    // row of the centre
  std::vector<float> weights;    // rows of `side`
  int side;

 private:
  int radius_;
};

}  // namespace patchmatch
