#include "images/interlacing.hpp"

#include <array>
#include <limits>

namespace endosdk {
namespace {

// Tiles: bands of rows all over the frame, in parts. Only some columns are looked at.
constexpr int bands = 16;
constexpr int rows = 10;
constexpr int tiles_along = 12;
constexpr int tile_columns = 20;
constexpr int columns = tiles_along * tile_columns;

constexpr int clearly = 3;     // halves: neighbouring rows differ by one and a half times as much
constexpr double flattest = 2.0;  // mean squared difference of neighbouring rows, grey levels

using Columns = std::array<ptrdiff_t, columns>;  // bytes from the beginning of a row
using Band = std::array<std::array<int16_t, columns>, rows>;

// Those that are looked at, of the middle channel.
Columns columns_of(const ImageView& frame) {
  Columns places;
  for (int x = 0; x < columns; ++x) {
    const int place = (x * frame.width + frame.width / 2) / columns;
    places[static_cast<size_t>(x)] = static_cast<ptrdiff_t>(place) * frame.channels + frame.channels / 2;
  }
  return places;
}

void read_band(const ImageView& frame, const Columns& places, int top, Band& band) {
  for (int y = 0; y < rows; ++y) {
    const uint8_t* const row = frame.row(top + y);
    for (size_t x = 0; x < columns; ++x) band[static_cast<size_t>(y)][x] = row[places[x]];
  }
}

int combed_tiles(const Band& band) {
  std::array<int32_t, columns> near{};
  std::array<int32_t, columns> far{};
  for (size_t y = 2; y < rows; ++y) {
    for (size_t x = 0; x < columns; ++x) {
      const int one = band[y][x] - band[y - 1][x];
      const int two = band[y][x] - band[y - 2][x];
      near[x] += one * one;
      far[x] += two * two;
    }
  }
  int combed = 0;
  for (size_t tile = 0; tile < tiles_along; ++tile) {
    int32_t one = 0;
    int32_t two = 0;
    for (size_t x = tile * tile_columns; x < (tile + 1) * tile_columns; ++x) {
      one += near[x];
      two += far[x];
    }
    constexpr int count = (rows - 2) * tile_columns;
    combed += one > flattest * count && 2 * one > clearly * two ? 1 : 0;
  }
  return combed;
}

}  // namespace

double combed_share(const ImageView& frame) {
  if (frame.width < columns || frame.height < bands * rows) return std::numeric_limits<double>::quiet_NaN();
  const Columns places = columns_of(frame);
  Band band;
  int combed = 0;
  for (int i = 0; i < bands; ++i) {
    read_band(frame, places, (frame.height - rows) * i / (bands - 1), band);
    combed += combed_tiles(band);
  }
  return static_cast<double>(combed) / (bands * tiles_along);
}

}  // namespace endosdk
