#include "images/same_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int columns = 480;    // blocks across a frame, about
constexpr int side = 12;        // blocks along a side of a tile
constexpr int tiles_along = 16;
constexpr int tiles_down = 12;
constexpr int least_tiles = 6;  // tiles with texture that a result needs
constexpr int most_samples = 4;  // per block, along each axis
constexpr float flattest = 2.0f;  // grey levels squared; below there is no texture
constexpr float most_noise = 0.3f;  // largest share of a tile's variance that is taken for noise

// Sums run down the columns of a tile first, so that the compiler can add whole rows.
using Row = std::array<float, side>;
using Tile = std::array<Row, side>;

float sum_of(const Row& row) {
  float sum = 0.0f;
  for (const float value : row) sum += value;
  return sum;
}

// Samples of the middle channel in a block: their number along each axis, and their distance.
struct Samples {
  int count;
  int apart;
};

constexpr Samples samples_of(int unit) { return {std::min(unit, most_samples), std::max(1, unit / most_samples)}; }

// Adds up the samples of each block in one row of a tile. This version is for colour frames of the usual sizes. It adds rows of
// pixels first. Their length is known when this is compiled, so the compiler uses vectors.
template <int unit>
void add_colour_blocks(const ImageView& image, int left, int top, std::array<int, side>& sums) {
  constexpr Samples samples = samples_of(unit);
  constexpr int channels = 3;
  std::array<uint16_t, size_t{side} * unit * channels> down{};
  for (int j = 0; j < samples.count; ++j) {
    const uint8_t* const row = image.row(top + j * samples.apart) + left * channels;
    for (size_t i = 0; i < down.size(); ++i) down[i] = static_cast<uint16_t>(down[i] + row[i]);
  }
  for (size_t u = 0; u < side; ++u) {
    const uint16_t* const block = down.data() + u * unit * channels + channels / 2;
    for (int i = 0; i < samples.count; ++i) sums[u] += block[i * samples.apart * channels];
  }
}

void add_any_blocks(const ImageView& image, int left, int top, int unit, std::array<int, side>& sums) {
  const Samples samples = samples_of(unit);
  const int apart = samples.apart * image.channels;
  for (int j = 0; j < samples.count; ++j) {
    const uint8_t* block = image.row(top + j * samples.apart) + left * image.channels + image.channels / 2;
    for (int& sum : sums) {
      int along = 0;  // a local sum: the compiler must assume that `sums` and the image may share memory
      for (int i = 0; i < samples.count; ++i) along += block[i * apart];
      sum += along;
      block += unit * image.channels;
    }
  }
}

void add_blocks(const ImageView& image, int left, int top, int unit, std::array<int, side>& sums) {
  switch (image.channels == 3 ? unit : 0) {
    case 1: return add_colour_blocks<1>(image, left, top, sums);
    case 2: return add_colour_blocks<2>(image, left, top, sums);
    case 3: return add_colour_blocks<3>(image, left, top, sums);
    case 4: return add_colour_blocks<4>(image, left, top, sums);
    case 8: return add_colour_blocks<8>(image, left, top, sums);
    default: return add_any_blocks(image, left, top, unit, sums);
  }
}

// One row of tiles of a view.
using Band = std::array<Tile, tiles_along>;

// Means of blocks of unit x unit pixels, less the mean of their tile. Each row of blocks is read through all tiles before the
// next row: every row of a large frame lies in memory pages of its own, and finding a page takes longer than reading it.
void read_band(const ImageView& image, int top, int unit, Band& band) {
  using Sums = std::array<int, side>;
  std::array<std::array<Sums, side>, tiles_along> sums{};
  for (int v = 0; v < side; ++v) {
    for (int i = 0; i < tiles_along; ++i) {
      const int left = (image.width - side * unit) * i / (tiles_along - 1);
      add_blocks(image, left, top + v * unit, unit, sums[static_cast<size_t>(i)][static_cast<size_t>(v)]);
    }
  }
  const int count = samples_of(unit).count;
  const float share = 1.0f / static_cast<float>(count * count);
  for (size_t i = 0; i < tiles_along; ++i) {
    int total = 0;
    for (const Sums& row : sums[i]) total = std::accumulate(row.begin(), row.end(), total);
    const float mean = share * static_cast<float>(total) / (side * side);
    for (size_t v = 0; v < side; ++v) {
      for (size_t u = 0; u < side; ++u) band[i][v][u] = share * static_cast<float>(sums[i][v][u]) - mean;
    }
  }
}

// Variance of the noise in a tile, from its mixed second difference: the mean square of this difference is 36 times the
// variance of white noise.
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
  float varies;        // variance of the view that has more
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
  if (differs == 0.0f) return {most, 0.0f};  // also where nothing changes along the rows
  const float steep = steepness_of(left);
  return {most, differs / (gain * gain * std::max(steep - 0.5f * left_noise, 0.1f * steep))};
}

}  // namespace

FrameDisplacement displacement_of_frames(const ImageView& left, const ImageView& right) {
  if (left.width != right.width || left.height != right.height || left.channels != right.channels) return {farthest_displacement, farthest_displacement};
  const int unit = std::max(1, (left.width + columns / 2) / columns);
  const int reach = side * unit;
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  if (left.width < reach || left.height < reach) return {unknown, unknown};
  std::array<Compared, size_t{tiles_along} * tiles_down> found;
  parallel_for(tiles_down, 1, [&](int begin, int end, int) {
    Band here;
    Band there;
    for (int j = begin; j < end; ++j) {
      const int top = (left.height - reach) * j / (tiles_down - 1);
      read_band(left, top, unit, here);
      read_band(right, top, unit, there);
      for (size_t i = 0; i < tiles_along; ++i) found[static_cast<size_t>(j) * tiles_along + i] = compare(here[i], there[i]);
    }
  });
  const auto flat = [](const Compared& tiles) { return tiles.varies < flattest; };
  const auto count = static_cast<size_t>(std::remove_if(found.begin(), found.end(), flat) - found.begin());
  if (count < least_tiles) return {unknown, unknown};
  const auto half = found.begin() + static_cast<ptrdiff_t>((count + 1) / 2);
  std::nth_element(found.begin(), half - 1, found.begin() + static_cast<ptrdiff_t>(count),
                   [](const Compared& a, const Compared& b) { return a.varies > b.varies; });
  const auto median = [&](auto begin, auto end) {
    const auto middle = begin + (end - begin) / 2;
    std::nth_element(begin, middle, end, [](const Compared& a, const Compared& b) { return a.displacement < b.displacement; });
    return std::min(std::sqrt(static_cast<double>(middle->displacement)) * unit * 1000.0 / left.width, farthest_displacement);
  };
  return {median(found.begin(), half), median(half, found.begin() + static_cast<ptrdiff_t>(count))};
}

}  // namespace endosdk
