// Both views of a pair, compared where the network matched them. All checks of whether a pixel, or a whole frame, can be
// trusted use these results.
//
// The results lie on a grid of about 240 cells along a row, whatever the size of the pictures. A cell is 2 x 2 pixels of a
// picture 480 px wide, and 4 x 4 pixels of a picture 960 px wide. Brightness has twice as many columns, because matches lie
// between cells.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "images/image.hpp"
#include "images/resize.hpp"
#include "images/size.hpp"
#include "kernels/kernels.hpp"
#include "maps/field_of_view.hpp"

namespace endosdk {

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class MatchedViews {
 public:
  static constexpr int columns = 480;  // columns of brightness, about

  // Known fields of view, left and right. A null field is found in the picture.
  using Fields = std::array<const FieldOfView*, 2>;

  // Number of cells of a picture, and pixels per column of brightness.
  static Size cells_of(Size picture);
  static int unit_of(Size picture);

  // Disparities are in pixels of the views. `picture` is the part of both views without the padding. `grid` is in cells of the
  // disparity map per pixel of the views.
  void compare(const FloatView& disparity, const PlanarView& left, const PlanarView& right, Size picture, Scale grid,
               const Fields& known);

  // Number of cells; 0 where the picture is too small for one cell.
  Size size() const { return cells_; }

  // Pixels of the view per column of brightness; a cell is two columns wide and high.
  int unit() const { return unit_; }

  // Place of a cell's centre along one axis of a map that has `per_pixel` values per pixel of the view, `count` in all; and the
  // cell, of `count` cells, in which such a place lies.
  int place_of(int cell, double per_pixel, int count) const {
    return std::min(static_cast<int>((2 * cell + 1) * unit_ * per_pixel), count - 1);
  }
  int cell_of(int place, double per_pixel, int count) const {
    return std::min(static_cast<int>((place + 0.5) / per_pixel) / (2 * unit_), count - 1);
  }

  // Standard deviation of the noise of one channel's pixels, grey levels.
  double left_noise() const { return left_noise_; }
  double right_noise() const { return right_noise_; }

  // Variance of the noise that averaging leaves in the columns of brightness, before they are smoothed, and in cells. View 0 is
  // the left one, 1 the right one.
  double noise_of_column(int view) const;
  double noise_of_cell(int view) const { return noise_of_column(view) * (6.0 + 4.0) / 32.0; }

  // Grey levels of cells, and whether they lie in the field of view.
  const float* levels(int view, int y) const { return levels_[view].data() + static_cast<ptrdiff_t>(y) * cells_.width; }
  bool sees(int view, int x, int y) const { return !field(view).is_part() || field(view).inside(x, y); }
  const FieldOfView& field(int view) const {
    const FieldOfView* const known = known_[static_cast<size_t>(view)];
    return known != nullptr ? *known : found_[view];
  }

  // Four values per cell. Disparity, in columns, is NaN for cells that are not compared: cells outside a field of view or at
  // its edge, and cells whose match lies there. Correlation of the views around the cell is NaN where there is nothing to
  // compare. Support is the share of the network's confidence that the pictures leave. Odds is the factor on the odds of this
  // confidence.
  const float* disparity(int y) const { return disparity_.data() + static_cast<ptrdiff_t>(y + edge_reach) * (cells_.width + 2 * edge_reach) + edge_reach; }
  const float* correlation(int y) const { return correlation_.data() + static_cast<ptrdiff_t>(y) * cells_.width; }
  const float* support(int y) const { return support_.data() + static_cast<ptrdiff_t>(y) * cells_.width; }
  const float* odds(int y) const { return odds_.data() + static_cast<ptrdiff_t>(y) * cells_.width; }

  // Rows of brightness, 2 * size().width values each.
  const float* left(int y) const { return brightness_[0].data() + static_cast<ptrdiff_t>(y) * 2 * cells_.width; }
  const float* right(int y) const { return brightness_[1].data() + static_cast<ptrdiff_t>(y) * 2 * cells_.width; }

  // Contrast of the left view over that of the right one, where they were matched: 2 where the right camera exposes half as
  // much. 1 where it cannot be told.
  double gain() const { return gain_; }

  // Upper bound of the mean correlation of all cells that can be compared, which the true mean exceeds for one pair in a
  // thousand; 0 if there are none. The share of the field of view that these cells make up.
  double most_correlation() const { return most_correlation_; }
  double textured_share() const { return textured_share_; }

 private:
  void make_room(Size picture);
  void read_brightness(const PlanarView* const (&views)[2]);
  void find_fields_and_noise(const PlanarView* const (&views)[2]);
  void find_field(int view);
  void match();
  void find_gain();
  void correlate();
  void place(const FloatView& disparity, Scale grid);
  void sum_up();

  float* scratch_of(int worker) { return scratch_.data() + static_cast<ptrdiff_t>(worker) * scratch_size_; }
  float* sums_of(int y);

  Size cells_;
  int unit_ = 0;
  double left_noise_ = 0.0;
  double right_noise_ = 0.0;
  double gain_ = 1.0;
  double most_correlation_ = 0.0;
  double textured_share_ = 0.0;
  Fields known_{};
  FieldOfView found_[2];
  std::vector<float> levels_[2];  // grey level of each cell
  std::vector<float> brightness_[2];
  std::vector<uint16_t> differences_[2];  // second differences of one row of pixels
  std::vector<float> disparity_;  // with edge_reach more cells on every side
  std::vector<float> sums_;  // sums of each row of cells, and one more row of zeros
  std::vector<float> correlation_;
  std::vector<float> support_;
  std::vector<float> odds_;
  std::vector<int32_t> columns_of_grid_;  // column of the disparity map for each cell
  int workers_ = 1;
  int scratch_size_ = 0;  // values per worker
  std::vector<float> scratch_;
};

}  // namespace endosdk
