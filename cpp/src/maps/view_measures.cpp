#include "maps/view_measures.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr int tile = 8;                // cells along a side
constexpr float blown_out = 245.0f;    // grey level of a cell
constexpr double flattest = 0.4;       // grey levels squared, beside a plane, that are no texture
constexpr int least_tiles = 12;        // with texture, to say that a view is covered
constexpr int rows_apart = 4;          // of those that tell sharpness
constexpr int edge_cells = 4;          // from the edge of a field of view, which is sharp whatever the focus
constexpr int most_passes = 24;        // of a mask 1 2 1, each a Gaussian of variance 1/2
constexpr int far = 4;                 // columns to each side

enum Texture : uint8_t { none = 0, flat = 1, textured = 2 };

// Share of white noise's variance that is left at a distance, after passes of 1 2 1 along the row.
double left_of_noise(int passes, int distance) {
  const int n = 2 * passes;
  double share = 1.0;  // binomial(2 n, n + distance) / 4^n
  for (int i = 1; i <= n; ++i) share *= (2.0 * i - 1.0) / (2.0 * i);
  for (int i = 1; i <= distance; ++i) share *= static_cast<double>(n - i + 1) / (n + i);
  return share;
}

// Variance of the cells of a tile beside the plane through them.
double roughness(const float* levels, int stride) {
  constexpr double count = tile * tile;
  constexpr double spread = (tile * tile - 1) / 12.0;  // variance of a place along one axis
  double sum = 0.0;
  double squares = 0.0;
  double along = 0.0;
  double down = 0.0;
  for (int y = 0; y < tile; ++y) {
    for (int x = 0; x < tile; ++x) {
      const double value = static_cast<double>(levels[y * stride + x]);
      sum += value;
      squares += value * value;
      along += value * (x - 0.5 * (tile - 1));
      down += value * (y - 0.5 * (tile - 1));
    }
  }
  const double mean = sum / count;
  const double slopes = (along * along + down * down) / (count * count * spread);
  return squares / count - mean * mean - slopes;
}

struct Light {
  double level;
  double saturated;
};

Light light_of(const MatchedViews& views, int view) {
  double sum = 0.0;
  int count = 0;
  int bright = 0;
  for (int y = 0; y < views.size().height; ++y) {
    const float* const levels = views.levels(view, y);
    for (int x = 0; x < views.size().width; ++x) {
      if (!views.sees(view, x, y)) continue;
      sum += static_cast<double>(levels[x]);
      bright += levels[x] >= blown_out ? 1 : 0;
      ++count;
    }
  }
  const double cells = std::max(1, count);
  return {sum / cells, bright / cells};
}

}  // namespace

void ViewMeasures::measure(const MatchedViews& views, int picture_width) {
  const Size cells = views.size();
  tiles_ = {cells.width / tile, cells.height / tile};
  row_.resize(static_cast<size_t>(4 * cells.width));
  for (auto& textures : textures_) textures.resize(static_cast<size_t>(tiles_.width) * static_cast<size_t>(tiles_.height));
  Light light[2];
  parallel_for(2, 1, [&](int begin, int end, int) {
    for (int view = begin; view < end; ++view) {
      light[view] = light_of(views, view);
      find_tiles(views, view);
    }
  });
  level_ = std::min(light[0].level, light[1].level);
  saturated_ = std::max(light[0].saturated, light[1].saturated);
  covered_ = std::fmax(covered_of(0), covered_of(1));
  blur_ = find_blur(views, picture_width);
}

void ViewMeasures::find_tiles(const MatchedViews& views, int view) {
  std::vector<uint8_t>& textures = textures_[view];
  const double limit = flattest + 3.0 * views.noise_of_cell(view);
  for (int y = 0; y < tiles_.height; ++y) {
    for (int x = 0; x < tiles_.width; ++x) {
      const int left = x * tile;
      const int top = y * tile;
      const int right = left + tile - 1;
      const int bottom = top + tile - 1;
      const bool seen = views.sees(view, left, top) && views.sees(view, right, top) && views.sees(view, left, bottom) &&
                        views.sees(view, right, bottom);
      uint8_t& texture = textures[static_cast<size_t>(y * tiles_.width + x)];
      texture = none;
      if (seen) texture = roughness(views.levels(view, top) + left, views.size().width) > limit ? textured : flat;
    }
  }
}

// What one view shows lies beside it in the other one, so that the tiles beside must be flat as well.
double ViewMeasures::covered_of(int flat_view) const {
  const std::vector<uint8_t>& here = textures_[flat_view];
  const std::vector<uint8_t>& there = textures_[1 - flat_view];
  int count = 0;
  int missing = 0;
  for (int y = 0; y < tiles_.height; ++y) {
    for (int x = 0; x < tiles_.width; ++x) {
      const size_t at = static_cast<size_t>(y * tiles_.width + x);
      if (there[at] != textured || here[at] == none) continue;
      ++count;
      const bool before = x == 0 || here[at - 1] != textured;
      const bool after = x + 1 == tiles_.width || here[at + 1] != textured;
      missing += here[at] == flat && before && after ? 1 : 0;
    }
  }
  return count >= least_tiles ? static_cast<double>(missing) / count : unknown;
}

// How much neighbours differ, as a share of how much columns farther apart do, in a view that was blurred by so many passes
// of 1 2 1 more. Noise is taken out.
double ViewMeasures::sharpness(const MatchedViews& views, int view, int passes) {
  double fine = 0.0;
  double coarse = 0.0;
  int count = 0;
  for (int y = rows_apart / 2; y < views.size().height; y += rows_apart) {
    const FieldOfView::Extent seen = views.field(view).extent(y, edge_cells);
    const int columns = 2 * (seen.last - seen.first + 1);
    if (columns <= 2 * far) continue;
    float* const row = row_.data();
    float* const other = row + columns;
    std::copy_n((view == 0 ? views.left(y) : views.right(y)) + 2 * seen.first, columns, row);
    for (int pass = 0; pass < passes; ++pass) {
      other[0] = row[0];
      other[columns - 1] = row[columns - 1];
      for (int x = 1; x + 1 < columns; ++x) other[x] = 0.25f * (row[x - 1] + row[x + 1]) + 0.5f * row[x];
      std::copy_n(other, columns, row);
    }
    for (int x = far; x + far < columns; ++x) {
      const double near = static_cast<double>(row[x + 1] - row[x - 1]);
      const double wide = static_cast<double>(row[x + far] - row[x - far]);
      fine += near * near;
      coarse += wide * wide;
      ++count;
    }
  }
  if (count == 0) return unknown;
  const double noise = 2.0 * views.noise_of_column(view);
  const auto noise_at = [&](int distance) { return noise * (left_of_noise(passes + 1, 0) - left_of_noise(passes + 1, distance)); };
  const double texture = coarse / count - noise_at(2 * far);
  return texture > noise ? std::max(0.0, fine / count - noise_at(2)) / texture : unknown;
}

double ViewMeasures::find_blur(const MatchedViews& views, int picture_width) {
  const double sharp[2] = {sharpness(views, 0, 0), sharpness(views, 1, 0)};
  if (std::isnan(sharp[0]) || std::isnan(sharp[1])) return unknown;
  const int sharper = sharp[0] > sharp[1] ? 0 : 1;
  const double wanted = sharp[1 - sharper];
  double before = sharp[sharper];
  double passes = most_passes;
  for (int i = 1; i <= most_passes; ++i) {
    const double here = sharpness(views, sharper, i);
    if (!(here > wanted)) {
      passes = i - 1 + (before - wanted) / std::max(1e-9, before - here);
      break;
    }
    before = here;
  }
  return std::sqrt(0.5 * std::min(passes, static_cast<double>(most_passes))) * views.unit() * 1000.0 / picture_width;
}

}  // namespace endosdk
