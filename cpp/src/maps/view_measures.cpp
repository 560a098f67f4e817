#include "maps/view_measures.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kernels/kernels.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr int tile = tile_cells;
constexpr float blown_out = 245.0f;    // grey level from which a cell is overexposed
constexpr double flattest = 0.4;       // grey levels squared about a fitted plane; up to it there is no texture
constexpr int least_tiles = 12;        // tiles with texture that are needed to call a view covered
constexpr int rows_apart = 4;          // distance of the rows that tell sharpness
constexpr int edge_cells = 4;          // left out along the edge of a field of view, which is sharp whatever the focus
constexpr int most_passes = 24;        // passes of the mask 1 2 1, each a Gaussian of variance 1/2
constexpr int far = 4;                 // columns to each side

enum Texture : uint8_t { outside = 0, flat = 1, rough = 2 };

// Autocovariance of white noise at this distance, as a share of its variance, after `passes` of the mask 1 2 1 along the row.
double left_of_noise(int passes, int distance) {
  const int n = 2 * passes;
  double share = 1.0;  // binomial(2 n, n + distance) / 4^n
  for (int i = 1; i <= n; ++i) share *= (2.0 * i - 1.0) / (2.0 * i);
  for (int i = 1; i <= distance; ++i) share *= static_cast<double>(n - i + 1) / (n + i);
  return share;
}

// Sums run down the columns first, so that the compiler can add whole rows.
void add_light(const float* levels, int count, float* __restrict sums, int& bright) {
  for (int x = 0; x < count; ++x) sums[x] += levels[x];
  for (int x = 0; x < count; ++x) bright += levels[x] >= blown_out ? 1 : 0;
}

// Adds the squared differences between the columns on both sides, 1 and `far` columns away, where `far` columns exist on both.
void add_steps(const float* row, int columns, float* __restrict fine, float* __restrict coarse) {
  for (int x = far; x < columns - far; ++x) {
    const float near = row[x + 1] - row[x - 1];
    const float wide = row[x + far] - row[x - far];
    fine[x] += near * near;
    coarse[x] += wide * wide;
  }
}

}  // namespace

void ViewMeasures::measure(const MatchedViews& views, int picture_width) {
  const Size cells = views.size();
  tiles_ = {cells.width / tile, cells.height / tile};
  for (auto& textures : textures_) textures.resize(count_of(tiles_));
  for (auto& roughness : roughness_) roughness.resize(static_cast<size_t>(tiles_.width));
  for (auto& sums : sums_) sums.resize(static_cast<size_t>(4 * cells.width));
  parallel_for(2, 1, [&](int begin, int end, int) {
    for (int view = begin; view < end; ++view) {
      find_light(views, view);
      find_tiles(views, view);
      read_rows(views, view);
    }
  });
  level_ = std::min(levels_[0], levels_[1]);
  saturated_ = std::max(shares_[0], shares_[1]);
  covered_ = find_covered(views);
  textured_ = std::fmax(textured_of(0), textured_of(1));
  blur_ = find_blur(views, picture_width);
}

void ViewMeasures::find_light(const MatchedViews& views, int view) {
  std::vector<float>& sums = sums_[view];
  std::fill(sums.begin(), sums.end(), 0.0f);
  int count = 0;
  int bright = 0;
  for (int y = 0; y < views.size().height; ++y) {
    const FieldOfView::Extent seen = views.field(view).extent(y, 0);
    if (seen.last < seen.first) continue;
    add_light(views.levels(view, y) + seen.first, seen.last - seen.first + 1, sums.data(), bright);
    count += seen.last - seen.first + 1;
  }
  const double cells = std::max(1, count);
  levels_[view] = std::accumulate(sums.begin(), sums.end(), 0.0) / cells;
  shares_[view] = bright / cells;
}

void ViewMeasures::find_tiles(const MatchedViews& views, int view) {
  std::vector<uint8_t>& textures = textures_[view];
  const auto limit = static_cast<float>(flattest + 3.0 * views.noise_of_cell(view));
  std::vector<float>& roughness = roughness_[view];
  for (int y = 0; y < tiles_.height; ++y) {
    const int top = y * tile;
    kernels().tile_row({views.levels(view, top), views.size().width, tiles_.width, roughness.data()});
    for (int x = 0; x < tiles_.width; ++x) {
      const int left = x * tile;
      const int right = left + tile - 1;
      const int bottom = top + tile - 1;
      const bool seen = views.sees(view, left, top) && views.sees(view, right, top) && views.sees(view, left, bottom) &&
                        views.sees(view, right, bottom);
      uint8_t& texture = textures[static_cast<size_t>(y * tiles_.width + x)];
      texture = outside;
      if (seen) texture = roughness[static_cast<size_t>(x)] > limit ? rough : flat;
    }
  }
}

double ViewMeasures::textured_of(int view) const {
  const std::vector<uint8_t>& tiles = textures_[view];
  const auto with = std::count(tiles.begin(), tiles.end(), uint8_t{rough});
  const auto without = std::count(tiles.begin(), tiles.end(), uint8_t{flat});
  return with + without >= least_tiles ? static_cast<double>(with) / static_cast<double>(with + without) : unknown;
}

bool ViewMeasures::flat_around(int view, int x, int y) const {
  const uint8_t* const row = textures_[view].data() + static_cast<ptrdiff_t>(y) * tiles_.width;
  return row[x] == flat && (x == 0 || row[x - 1] != rough) && (x + 1 == tiles_.width || row[x + 1] != rough);
}

// Compares each tile of the left view with the tile of its match. Matches lie a part of a tile off, and the network knows little
// about a covered lens, so the tiles beside count as well.
double ViewMeasures::find_covered(const MatchedViews& views) const {
  int counts[2] = {};
  int missing[2] = {};
  for (int y = 0; y < tiles_.height; ++y) {
    const float* const disparity = views.disparity(y * tile + tile / 2);
    const int row = y * tiles_.width;
    for (int x = 0; x < tiles_.width; ++x) {
      const int cell = x * tile + tile / 2;
      const float match = static_cast<float>(cell) - 0.5f * disparity[cell];
      if (!(match >= 0.0f && match < static_cast<float>(tiles_.width * tile))) continue;  // false for NaN
      const int places[2] = {x, static_cast<int>(match) / tile};
      for (int view = 0; view < 2; ++view) {
        const int other = 1 - view;
        if (textures_[view][static_cast<size_t>(row + places[view])] != rough) continue;
        if (textures_[other][static_cast<size_t>(row + places[other])] == outside) continue;
        ++counts[view];
        missing[view] += flat_around(other, places[other], y) ? 1 : 0;
      }
    }
  }
  double most = unknown;
  for (int view = 0; view < 2; ++view) {
    if (counts[view] >= least_tiles) most = std::fmax(most, static_cast<double>(missing[view]) / counts[view]);
  }
  return most;
}

void ViewMeasures::read_rows(const MatchedViews& views, int view) {
  Rows& rows = rows_[view];
  const int height = views.size().height;
  const int stride = 2 * views.size().width;
  rows.counts.assign(static_cast<size_t>((height + rows_apart - 1) / rows_apart), 0);
  rows.values.resize(rows.counts.size() * static_cast<size_t>(stride));
  float* out = rows.values.data();
  size_t i = 0;
  for (int y = rows_apart / 2; y < height; y += rows_apart, ++i, out += stride) {
    const FieldOfView::Extent seen = views.field(view).extent(y, edge_cells);
    const int columns = 2 * (seen.last - seen.first + 1);
    if (columns <= 2 * far) continue;
    rows.counts[i] = columns;
    std::copy_n((view == 0 ? views.left(y) : views.right(y)) + 2 * seen.first, columns, out);
  }
}

// One more pass of the mask 1 2 1.
void ViewMeasures::blur_rows(const MatchedViews& views, int view) {
  std::vector<float>& blurred = sums_[view];
  float* row = rows_[view].values.data();
  for (const int columns : rows_[view].counts) {
    for (int x = 1; x + 1 < columns; ++x) blurred[static_cast<size_t>(x)] = 0.25f * (row[x - 1] + row[x + 1]) + 0.5f * row[x];
    if (columns > 2) std::copy_n(blurred.data() + 1, columns - 2, row + 1);
    row += 2 * views.size().width;
  }
}

// How much neighbouring columns differ, divided by how much columns farther apart differ. The rows of the view were blurred by
// `passes` of the mask 1 2 1. The share of noise is subtracted.
double ViewMeasures::sharpness(const MatchedViews& views, int view, int passes) {
  std::vector<float>& sums = sums_[view];
  std::fill(sums.begin(), sums.end(), 0.0f);
  const int stride = 2 * views.size().width;
  int count = 0;
  const float* row = rows_[view].values.data();
  for (const int columns : rows_[view].counts) {
    add_steps(row, columns, sums.data(), sums.data() + stride);
    count += std::max(0, columns - 2 * far);
    row += stride;
  }
  const auto half = sums.begin() + stride;
  const double fine = std::accumulate(sums.begin(), half, 0.0);
  const double coarse = std::accumulate(half, sums.end(), 0.0);
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
    blur_rows(views, sharper);
    const double here = sharpness(views, sharper, i);
    if (std::isnan(here)) {  // nothing but noise is left: it takes at least this much to be as soft as the other view
      passes = i - 1;
      break;
    }
    if (here <= wanted) {
      passes = i - 1 + (before - wanted) / std::max(1e-9, before - here);
      break;
    }
    before = here;
  }
  return std::sqrt(0.5 * std::min(passes, static_cast<double>(most_passes))) * views.unit() * 1000.0 / picture_width;
}

}  // namespace endosdk
