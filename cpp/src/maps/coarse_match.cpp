#include "maps/coarse_match.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace endosdk {
namespace {

// A patch, every second column of it, in columns and rows of brightness; so that a picture has about a hundred.
constexpr int reach_columns = 10;
constexpr int column_step = 2;
constexpr int reach_rows = 4;
constexpr int across = 8;
constexpr int down = 8;
constexpr int count = (2 * reach_columns / column_step + 1) * (2 * reach_rows + 1);

constexpr int farthest_row = 10;
constexpr int row_step = 2;
constexpr float least_variance = 4.0f;  // grey levels squared
constexpr int least_patches = 16;

// Correlation that a patch gains on another row before that tells something.
constexpr float clear_gain = 0.15f;

// Patches that moved by about as many rows, of all that were looked for on other rows. Views that share nothing reach two fifths.
constexpr int alike_rows = 2;
constexpr double least_agreement = 0.5;

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

struct Patch {
  float values[count];
  float deviation;  // root of the sum of squares about the mean, which is taken off
};

bool read(const float* plane, int columns, int x, int y, Patch& patch) {
  float sum = 0.0f;
  int i = 0;
  for (int r = -reach_rows; r <= reach_rows; ++r) {
    const float* const row = plane + static_cast<ptrdiff_t>(y + r) * columns + x;
    for (int c = -reach_columns; c <= reach_columns; c += column_step) sum += patch.values[i++] = row[c];
  }
  const float mean = sum / static_cast<float>(count);
  float squares = 0.0f;
  for (float& value : patch.values) {
    value -= mean;
    squares += value * value;
  }
  patch.deviation = std::sqrt(squares);
  return squares > least_variance * static_cast<float>(count);
}

float correlation(const Patch& a, const Patch& b) {
  float sum = 0.0f;
  for (int i = 0; i < count; ++i) sum += a.values[i] * b.values[i];
  return sum / (a.deviation * b.deviation);
}

// The mean of the rows about their median; not a number where too few patches, of those tried, moved alike.
double common_rows(int* rows, int found, int tried) {
  if (found == 0) return nothing;
  std::nth_element(rows, rows + found / 2, rows + found);
  const int middle = rows[found / 2];
  int sum = 0;
  int alike = 0;
  for (int i = 0; i < found; ++i) {
    if (std::abs(rows[i] - middle) > alike_rows) continue;
    sum += rows[i];
    ++alike;
  }
  return alike < least_agreement * tried ? nothing : static_cast<double>(sum) / alike;
}

}  // namespace

CoarseMatch::Best CoarseMatch::best_of(int x, int y, int direction, int nearest, int farthest) const {
  const int columns = 2 * views_->size().width;
  const int longest = columns / 4;
  Patch here;
  Patch there;
  Best best;
  if (!read(views_->left(0), columns, x, y, here)) return best;
  for (int row = -farthest; row <= farthest; row += row_step) {
    for (int d = nearest; d <= longest; d += column_step) {
      if (!read(views_->right(0), columns, x + direction * d, y + row, there)) continue;
      const float seen = correlation(here, there);
      if (seen > best.correlation) best = {seen, row};
    }
  }
  return best;
}

void CoarseMatch::measure(const MatchedViews& views) {
  views_ = &views;
  exchanged_gain_ = rows_off_ = nothing;
  std::array<int, across * down> rows;
  int found = 0;
  const int columns = 2 * views.size().width;
  const int height = views.size().height;
  const int margin = columns / 4 + reach_columns + 1;
  const int edge = farthest_row + reach_rows;
  if (columns <= 2 * margin || height <= 2 * edge) return;
  // Views that are not rectified may cross: what is far then lies a little on the other side.
  const int crossed = -(columns / 16 / column_step * column_step);
  double gain = 0.0;
  int patches = 0;
  int tried = 0;
  for (int j = 0; j < down; ++j) {
    for (int i = 0; i < across; ++i) {
      const int x = margin + i * (columns - 1 - 2 * margin) / (across - 1);
      const int y = edge + j * (height - 1 - 2 * edge) / (down - 1);
      // Over the same distances to either side, so that chance favours neither.
      const Best same = best_of(x, y, -1, column_step, 0);
      const Best exchanged = best_of(x, y, 1, column_step, 0);
      if (same.correlation < 0.0f || exchanged.correlation < 0.0f) continue;
      gain += static_cast<double>(exchanged.correlation - same.correlation);
      ++patches;
      if ((i + j) % 2 != 0) continue;
      ++tried;
      const Best off = best_of(x, y, -1, crossed, farthest_row);
      if (off.correlation > same.correlation + clear_gain) rows[static_cast<size_t>(found++)] = off.rows;
    }
  }
  if (patches < least_patches) return;
  exchanged_gain_ = gain / patches;
  rows_off_ = common_rows(rows.data(), found, tried);
}

}  // namespace endosdk
