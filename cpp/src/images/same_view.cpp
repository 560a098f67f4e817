#include "images/same_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace endosdk {
namespace {

constexpr int columns = 480;    // of blocks, about
constexpr int side = 12;        // blocks of a tile
constexpr int tiles_along = 16;
constexpr int tiles_down = 12;
constexpr int least_tiles = 6;  // with texture
constexpr double flattest = 2.0;  // grey levels squared that are no texture
constexpr double most_noise = 0.3;  // of a tile's variance
constexpr double infinity = std::numeric_limits<double>::infinity();

// Means of blocks of unit x unit pixels of the middle channel.
using Tile = std::array<std::array<double, side>, side>;

Tile tile_of(const ImageView& image, int x, int y, int unit) {
  const int channel = image.channels / 2;
  const double share = 1.0 / (unit * unit);
  Tile tile;
  for (int v = 0; v < side; ++v) {
    for (int u = 0; u < side; ++u) {
      int sum = 0;
      for (int j = 0; j < unit; ++j) {
        const uint8_t* const row = image.row(y + v * unit + j) + channel;
        for (int i = 0; i < unit; ++i) sum += row[(x + u * unit + i) * image.channels];
      }
      tile[v][u] = share * sum;
    }
  }
  return tile;
}

// Mean square of a tile's mixed second difference, which of white noise is 36 times its variance.
double noise_of(const Tile& t) {
  double squares = 0.0;
  for (int y = 1; y + 1 < side; ++y) {
    for (int x = 1; x + 1 < side; ++x) {
      const double corners = t[y - 1][x - 1] + t[y - 1][x + 1] + t[y + 1][x - 1] + t[y + 1][x + 1];
      const double sides = t[y - 1][x] + t[y][x - 1] + t[y][x + 1] + t[y + 1][x];
      const double value = corners - 2.0 * sides + 4.0 * t[y][x];
      squares += value * value;
    }
  }
  return squares / (36.0 * (side - 2) * (side - 2));
}

double mean_of_products(const Tile& a, const Tile& b) {
  double sum = 0.0;
  double first = 0.0;
  double second = 0.0;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      sum += a[y][x] * b[y][x];
      first += a[y][x];
      second += b[y][x];
    }
  }
  constexpr double count = side * side;
  return sum / count - first / count * (second / count);
}

double steepness_of(const Tile& t) {
  double squares = 0.0;
  for (int y = 0; y < side; ++y) {
    for (int x = 1; x + 1 < side; ++x) {
      const double slope = 0.5 * (t[y][x + 1] - t[y][x - 1]);
      squares += slope * slope;
    }
  }
  return squares / (side * (side - 2));
}

struct Compared {
  double varies;        // of the view with more
  double displacement;  // blocks squared
};

Compared compare(const Tile& left, const Tile& right) {
  const double varies = mean_of_products(left, left);
  const double varies_right = mean_of_products(right, right);
  const double most = std::max(varies, varies_right);
  const double left_noise = std::min(noise_of(left), most_noise * varies);
  const double right_noise = std::min(noise_of(right), most_noise * varies_right);
  const double together = mean_of_products(left, right);
  if (together <= 0.0) return {most, infinity};
  const double signal = varies - left_noise;
  const double gain = together / signal;
  const double differs = std::max(0.0, varies_right - right_noise - gain * together);
  const double steep = steepness_of(left);
  return {most, differs / (gain * gain * std::max(steep - 0.5 * left_noise, 0.1 * steep))};
}

}  // namespace

double displacement_of_frames(const ImageView& left, const ImageView& right) {
  if (left.width != right.width || left.height != right.height || left.channels != right.channels) return infinity;
  const int unit = std::max(1, (left.width + columns / 2) / columns);
  const int reach = side * unit;
  if (left.width < reach || left.height < reach) return std::numeric_limits<double>::quiet_NaN();
  std::array<Compared, size_t{tiles_along} * tiles_down> found;
  size_t count = 0;
  for (int j = 0; j < tiles_down; ++j) {
    const int y = (left.height - reach) * j / (tiles_down - 1);
    for (int i = 0; i < tiles_along; ++i) {
      const int x = (left.width - reach) * i / (tiles_along - 1);
      const Compared tiles = compare(tile_of(left, x, y, unit), tile_of(right, x, y, unit));
      if (tiles.varies >= flattest) found[count++] = tiles;
    }
  }
  if (count < least_tiles) return std::numeric_limits<double>::quiet_NaN();
  const auto half = found.begin() + static_cast<ptrdiff_t>((count + 1) / 2);
  std::nth_element(found.begin(), half - 1, found.begin() + static_cast<ptrdiff_t>(count),
                   [](const Compared& a, const Compared& b) { return a.varies > b.varies; });
  const auto middle = found.begin() + (half - found.begin()) / 2;
  std::nth_element(found.begin(), middle, half,
                   [](const Compared& a, const Compared& b) { return a.displacement < b.displacement; });
  return std::sqrt(middle->displacement) * unit * 1000.0 / left.width;
}

}  // namespace endosdk
