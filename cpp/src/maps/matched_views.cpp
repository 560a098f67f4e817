#include "maps/matched_views.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "kernels/kernels.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 4;
constexpr int edge_cells = 1;  // left out along the edge of a field of view, because they show both sides
constexpr double one_in_a_thousand = 3.09;  // standard deviations
constexpr int rows_per_gain = 8;  // contrast is read in every eighth row
constexpr double least_contrast = 4.0;  // grey levels squared; less tells nothing of the gain
constexpr double most_gain = 4.0;
constexpr double smoothed = (1.0 + 4.0 + 1.0) / 16.0;  // what the mask 1 2 1 of the brightness leaves of the noise of a column
constexpr float unknown = std::numeric_limits<float>::quiet_NaN();

// Standard deviation of the noise, from the median size of the mixed second difference. A mask of 1 -2 1 along both axes makes
// white noise six times as strong. Half of the values of a normal law lie within 0.6745 standard deviations. Texture hardly
// changes the median. Pixels outside the field of view are left out, because they may have no noise.
double noise_of(const PlanarView& view, Size cells, int unit, const FieldOfView& field, std::vector<uint16_t>& differences) {
  constexpr int green = 1;
  constexpr int largest = 8 * 255;
  constexpr double half = 0.6745 * 6.0;
  // Two histograms in turn: most differences are equal, and the processor waits for a count that was just changed.
  std::array<int, largest + 1> one{};
  std::array<int, largest + 1> other{};
  const int step = 2 * unit;
  differences.resize(static_cast<size_t>(cells.width * step));
  int count = 0;
  for (int y = 1; y + 1 < cells.height * step; y += 2 * step) {
    const FieldOfView::Extent seen = field.extent(y / step, 0);
    const int first = seen.first * step;
    const int width = (seen.last + 1) * step - first;
    kernels().noise_row(view.row(green, y - 1) + first, view.row(green, y) + first, view.row(green, y + 1) + first, width, differences.data());
    int x = 1;
    for (; x + step + 1 < width; x += 2 * step, count += 2) {
      ++one[differences[static_cast<size_t>(x)]];
      ++other[differences[static_cast<size_t>(x + step)]];
    }
    if (x + 1 < width) {
      ++one[differences[static_cast<size_t>(x)]];
      ++count;
    }
  }
  int below_it = 0;
  for (int value = 0; value <= largest; ++value) {
    const int here = one[static_cast<size_t>(value)] + other[static_cast<size_t>(value)];
    // Interpolates between whole values, so that noise below one grey level does not count as 0.
    if (here > 0 && 2 * (below_it + here) >= count) return (value + (0.5 * count - below_it) / here - (value > 0 ? 0.5 : 0.0)) / half;
    below_it += here;
  }
  return 0.0;
}

}  // namespace

int MatchedViews::unit_of(Size picture) { return std::max(1, (picture.width + columns / 2) / columns); }

Size MatchedViews::cells_of(Size picture) {
  const int cell = 2 * unit_of(picture);
  const Size cells = {picture.width / cell, picture.height / cell};
  return cells.width == 0 || cells.height == 0 ? Size() : cells;
}

void MatchedViews::compare(const FloatView& disparity, const PlanarView& left, const PlanarView& right, Size picture,
                           Scale grid, const Fields& known) {
  make_room(picture);
  known_ = known;
  if (count_of(cells_) == 0) {
    left_noise_ = right_noise_ = most_correlation_ = textured_share_ = 0.0;
    gain_ = 1.0;
    return;
  }
  const PlanarView* const views[] = {&left, &right};
  read_brightness(views);
  find_fields_and_noise(views);
  place(disparity, grid);
  match();
  find_gain();
  correlate();
  sum_up();
}

void MatchedViews::make_room(Size picture) {
  unit_ = unit_of(picture);
  cells_ = cells_of(picture);
  const size_t cells = count_of(cells_);
  for (auto& plane : brightness_) plane.resize(2 * cells);
  for (auto& plane : levels_) plane.resize(cells);
  correlation_.resize(cells);
  support_.resize(cells);
  odds_.resize(cells);
  sums_.resize(correlation_sums * (cells + static_cast<size_t>(cells_.width)));
  scratch_size_ = std::max(2 * cells_.width, correlation_sums * (cells_.width + 2 * correlation_reach));
  workers_ = thread_count();
  scratch_.resize(static_cast<size_t>(workers_) * static_cast<size_t>(scratch_size_));
}

float* MatchedViews::sums_of(int y) { return sums_.data() + static_cast<ptrdiff_t>(y) * correlation_sums * cells_.width; }

void MatchedViews::read_brightness(const PlanarView* const (&views)[2]) {
  const auto read_rows = [&](int begin, int end, int worker) {
    for (int i = begin; i < end; ++i) {
      const int view = i % 2;
      const int y = i / 2;
      BrightnessRow row{};
      for (int c = 0; c < 3; ++c) row.channel[c] = views[view]->row(c, y * 2 * unit_);
      row.stride = views[view]->width;
      row.unit = unit_;
      row.count = 2 * cells_.width;
      row.scratch = scratch_of(worker);
      row.out = brightness_[view].data() + static_cast<ptrdiff_t>(y) * row.count;
      kernels().brightness_row(row);
    }
  };
  parallel_for(2 * cells_.height, 2 * rows_per_block, read_rows, workers_);
}

void MatchedViews::find_fields_and_noise(const PlanarView* const (&views)[2]) {
  double* const noise[] = {&left_noise_, &right_noise_};
  parallel_for(2, 1, [&](int begin, int end, int) {
    for (int i = begin; i < end; ++i) {
      find_field(i);
      *noise[i] = noise_of(*views[i], cells_, unit_, field(i), differences_[i]);
    }
  });
}

// Sums along the rows of both views, where they were matched.
void MatchedViews::match() {
  std::fill_n(sums_of(cells_.height), correlation_sums * cells_.width, 0.0f);
  const auto match_rows = [&](int begin, int end, int worker) {
    for (int y = begin; y < end; ++y) {
      kernels().match_row({left(y), right(y), 2 * cells_.width, disparity(y), cells_.width, scratch_of(worker), sums_of(y)});
    }
  };
  parallel_for(cells_.height, rows_per_block, match_rows, workers_);
}

// The contrast of each view is its variance over the whole picture, so blur in one view changes it little.
void MatchedViews::find_gain() {
  std::array<double, correlation_sums> total{};
  for (int y = 0; y < cells_.height; y += rows_per_gain) {
    const float* plane = sums_of(y);
    for (double& sum : total) {
      // Lanes, so that the processor need not wait for each sum before it adds to it.
      std::array<float, 8> lanes{};
      for (int x = 0; x < cells_.width; ++x) lanes[static_cast<size_t>(x % 8)] += plane[x];
      sum += std::accumulate(lanes.begin(), lanes.end(), 0.0);
      plane += cells_.width;
    }
  }
  const double count = std::max(1.0, total[0]);
  const auto contrast = [&](size_t view) {
    const double mean = total[1 + view] / count;
    return total[3 + view] / count - mean * mean - smoothed * noise_of_column(static_cast<int>(view));
  };
  const double left = contrast(0);
  const double right = contrast(1);
  gain_ = std::min(left, right) > least_contrast ? std::clamp(std::sqrt(left / right), 1.0 / most_gain, most_gain) : 1.0;
}

void MatchedViews::correlate() {
  const auto left_variance = static_cast<float>(smoothed * noise_of_column(0));
  const auto right_variance = static_cast<float>(smoothed * noise_of_column(1));
  const auto correlate_rows = [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      CorrelationRow row{};
      for (int w = 0; w < correlation_window; ++w) {
        const int from = y + w - correlation_reach;
        row.sums[w] = sums_of(from >= 0 && from < cells_.height ? from : cells_.height);
      }
      for (int i = 0; i < edge_window; ++i) row.disparity[i] = disparity(y + i - edge_reach) - edge_reach;
      row.cells = cells_.width;
      row.left_noise = left_variance;
      row.right_noise = right_variance;
      row.correlation = correlation_.data() + static_cast<ptrdiff_t>(y) * cells_.width;
      row.support = support_.data() + static_cast<ptrdiff_t>(y) * cells_.width;
      row.odds = odds_.data() + static_cast<ptrdiff_t>(y) * cells_.width;
      kernels().correlation_row(row);
    }
  };
  parallel_for(cells_.height, rows_per_block, correlate_rows);
}

// Each cell takes the disparity that the map has at the centre of the cell. The outermost cells are repeated.
void MatchedViews::place(const FloatView& disparity, Scale grid) {
  const int stride = cells_.width + 2 * edge_reach;
  disparity_.resize(static_cast<size_t>(stride) * static_cast<size_t>(cells_.height + 2 * edge_reach));
  columns_of_grid_.resize(static_cast<size_t>(cells_.width));
  for (int x = 0; x < cells_.width; ++x) columns_of_grid_[static_cast<size_t>(x)] = place_of(x, grid.x, disparity.width);
  const int32_t* const column = columns_of_grid_.data();
  const bool whole = !field(0).is_part() && !field(1).is_part();
  const float columns_per_pixel = 1.0f / static_cast<float>(unit_);
  for (int y = -edge_reach; y < cells_.height + edge_reach; ++y) {
    const int row = std::clamp(y, 0, cells_.height - 1);
    const int from = place_of(row, grid.y, disparity.height);
    const FieldOfView::Extent left = field(0).extent(row, edge_cells);
    const FieldOfView::Extent right = field(1).extent(row, edge_cells);
    const float* const source = disparity.data + static_cast<ptrdiff_t>(from) * disparity.width;
    float* const out = disparity_.data() + static_cast<ptrdiff_t>(y + edge_reach) * stride;
    float* const cell = out + edge_reach;
    for (int x = 0; x < cells_.width; ++x) cell[x] = columns_per_pixel * source[column[x]];
    if (!whole) {
      std::fill(cell, cell + std::min(left.first, cells_.width), unknown);
      std::fill(cell + std::clamp(left.last + 1, 0, cells_.width), cell + cells_.width, unknown);
      const float first = field(1).is_part() ? static_cast<float>(right.first) : -std::numeric_limits<float>::infinity();
      const float last = field(1).is_part() ? static_cast<float>(right.last) : std::numeric_limits<float>::infinity();
      for (int x = left.first; x <= left.last; ++x) {
        const float match = static_cast<float>(x) - 0.5f * cell[x];
        if (!(match >= first && match <= last)) cell[x] = unknown;
      }
    }
    std::fill_n(out, edge_reach, cell[0]);
    std::fill_n(cell + cells_.width, edge_reach, cell[cells_.width - 1]);
  }
}

double MatchedViews::noise_of_column(int view) const {
  constexpr double channels = (1.0 + 4.0 + 1.0) / 16.0;
  const double noise = view == 0 ? left_noise_ : right_noise_;
  return noise * noise * channels / (2.0 * unit_ * unit_);
}

void MatchedViews::find_field(int view) {
  std::vector<float>& levels = levels_[view];
  const float* const columns_of_view = brightness_[view].data();
  for (size_t i = 0; i < levels.size(); ++i) levels[i] = 0.5f * (columns_of_view[2 * i] + columns_of_view[2 * i + 1]);
  if (known_[static_cast<size_t>(view)] == nullptr) found_[view].find(levels.data(), cells_);
}

// Sums run down the columns first, so that the compiler can add whole rows.
void MatchedViews::sum_up() {
  const auto width = static_cast<size_t>(cells_.width);
  std::fill_n(scratch_.begin(), 3 * width, 0.0f);
  float* const sums = scratch_.data();
  float* const squares = sums + width;
  float* const known = squares + width;
  for (int y = 0; y < cells_.height; ++y) {
    const FieldOfView::Extent seen = field(0).extent(y, 0);
    const int x = seen.first;
    kernels().add_known(correlation(y) + x, seen.last - x + 1, sums + x, squares + x, known + x);
  }
  const auto total = [](const float* values, size_t count) { return std::accumulate(values, values + count, 0.0); };
  const double sum = total(sums, width);
  const double squared = total(squares, width);
  const double textured = total(known, width);
  const double windows = std::max(1.0, textured / correlation_cells);
  const double mean = textured > 0 ? sum / textured : 0.0;
  const double variance = textured > 0 ? std::max(0.0, squared / textured - mean * mean) : 1.0;
  most_correlation_ = mean + one_in_a_thousand * std::sqrt(variance / windows);
  textured_share_ = textured / (field(0).share() * static_cast<double>(correlation_.size()));
}

}  // namespace endosdk
