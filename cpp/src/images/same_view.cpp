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
constexpr int most_samples = 4;  // of a block, along each axis
constexpr float flattest = 2.0f;  // grey levels squared that are no texture
constexpr float most_noise = 0.3f;  // of a tile's variance

// Sums run down the columns of a tile first, so that the compiler adds whole rows.
using Row = std::array<float, side>;
using Tile = std::array<Row, side>;

float sum_of(const Row& row) {
  float sum = 0.0f;
  for (const float value : row) sum += value;
  return sum;
}

// Samples of the middle channel, a block's along each axis and how far they lie apart.
struct Samples {
  int count;
  int apart;
};

Samples samples_of(int unit) { return {std::min(unit, most_samples), std::max(1, unit / most_samples)}; }

// Means of blocks of unit x unit pixels about that of the tile. Zero for a number that is known at run time alone.
template <int fixed_count, int fixed_channels>
void read_tile(const ImageView& image, int left, int top, int unit, Tile& tile) {
  const Samples samples = samples_of(unit);
  const int count = fixed_count > 0 ? fixed_count : samples.count;
  const int channels = fixed_channels > 0 ? fixed_channels : image.channels;
  int total = 0;
  std::array<std::array<int, side>, side> sums;
  for (size_t v = 0; v < side; ++v) {
    sums[v].fill(0);
    for (int j = 0; j < count; ++j) {
      const uint8_t* const row = image.row(top + static_cast<int>(v) * unit + j * samples.apart) + left * channels + channels / 2;
      for (size_t u = 0; u < side; ++u) {
        const uint8_t* const block = row + static_cast<int>(u) * unit * channels;
        for (int i = 0; i < count; ++i) sums[v][u] += block[i * samples.apart * channels];
      }
    }
    for (const int sum : sums[v]) total += sum;
  }
  const float share = 1.0f / static_cast<float>(count * count);
  const float mean = share * static_cast<float>(total) / (side * side);
  for (size_t v = 0; v < side; ++v) {
    for (size_t u = 0; u < side; ++u) tile[v][u] = share * static_cast<float>(sums[v][u]) - mean;
  }
}

void read(const ImageView& image, int left, int top, int unit, Tile& tile) {
  const bool colour = image.channels == 3;
  switch (colour ? unit : 0) {
    case 1: return read_tile<1, 3>(image, left, top, 1, tile);
    case 2: return read_tile<2, 3>(image, left, top, 2, tile);
    default: return read_tile<0, 0>(image, left, top, unit, tile);
  }
}

// Asks for the memory of a tile that is read next: tiles lie too far apart for the processor to foresee.
void fetch(const ImageView& image, int left, int top, int unit) {
  constexpr int line = 64;  // bytes, as a rule
  const ptrdiff_t first = ptrdiff_t{left} * image.channels;
  const ptrdiff_t bytes = ptrdiff_t{side} * unit * image.channels;
  for (int y = top; y < top + side * unit; ++y) {
    for (ptrdiff_t at = first; at < first + bytes + line; at += line) __builtin_prefetch(image.row(y) + std::min(at, first + bytes - 1));
  }
}

// Mean square of a tile's mixed second difference, which of white noise is 36 times its variance.
float noise_of(const Tile& t) {
  Row squares{};
  for (size_t y = 1; y + 1 < side; ++y) {
    Row along;  // second differences across the rows, of every column
    for (size_t x = 0; x < side; ++x) along[x] = t[y - 1][x] - 2.0f * t[y][x] + t[y + 1][x];
    for (size_t x = 1; x + 1 < side; ++x) {
      const float value = along[x - 1] - 2.0f * along[x] + along[x + 1];
      squares[x] += value * value;
    }
  }
  return sum_of(squares) / (36.0f * (side - 2) * (side - 2));
}

float mean_of_products(const Tile& a, const Tile& b) {
  Row sums{};
  for (size_t y = 0; y < side; ++y) {
    for (size_t x = 0; x < side; ++x) sums[x] += a[y][x] * b[y][x];
  }
  return sum_of(sums) / (side * side);
}

float steepness_of(const Tile& t) {
  Row squares{};
  for (size_t y = 0; y < side; ++y) {
    for (size_t x = 1; x + 1 < side; ++x) {
      const float slope = 0.5f * (t[y][x + 1] - t[y][x - 1]);
      squares[x] += slope * slope;
    }
  }
  return sum_of(squares) / (side * (side - 2));
}

struct Compared {
  float varies;        // of the view with more
  float displacement;  // blocks squared; infinite where the tiles have nothing in common
};

Compared compare(const Tile& left, const Tile& right) {
  const float varies = mean_of_products(left, left);
  const float varies_right = mean_of_products(right, right);
  const float most = std::max(varies, varies_right);
  const float together = mean_of_products(left, right);
  if (together <= 0.0f || most < flattest) return {most, std::numeric_limits<float>::infinity()};
  const float left_noise = std::min(noise_of(left), most_noise * varies);
  const float right_noise = std::min(noise_of(right), most_noise * varies_right);
  const float gain = together / (varies - left_noise);
  const float differs = std::max(0.0f, varies_right - right_noise - gain * together);
  const float steep = steepness_of(left);
  return {most, differs / (gain * gain * std::max(steep - 0.5f * left_noise, 0.1f * steep))};
}

}  // namespace

double displacement_of_frames(const ImageView& left, const ImageView& right) {
  if (left.width != right.width || left.height != right.height || left.channels != right.channels) return farthest_displacement;
  const int unit = std::max(1, (left.width + columns / 2) / columns);
  const int reach = side * unit;
  if (left.width < reach || left.height < reach) return std::numeric_limits<double>::quiet_NaN();
  std::array<Compared, size_t{tiles_along} * tiles_down> found;
  size_t count = 0;
  Tile here;
  Tile there;
  for (int j = 0; j < tiles_down; ++j) {
    const int y = (left.height - reach) * j / (tiles_down - 1);
    for (int i = 0; i < tiles_along; ++i) {
      const auto column = [&](int tile) { return (left.width - reach) * tile / (tiles_along - 1); };
      const int x = column(i);
      if (i + 1 < tiles_along) {
        fetch(left, column(i + 1), y, unit);
        fetch(right, column(i + 1), y, unit);
      }
      read(left, x, y, unit, here);
      read(right, x, y, unit, there);
      const Compared tiles = compare(here, there);
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
  return std::min(std::sqrt(static_cast<double>(middle->displacement)) * unit * 1000.0 / left.width, farthest_displacement);
}

}  // namespace endosdk
