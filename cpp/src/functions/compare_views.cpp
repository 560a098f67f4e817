// Compares two views at the disparity found, and at the nearest and the farthest disparity of the cells around.
#include <algorithm>
#include <array>
#include <cstring>

#include "functions/extremes.hpp"
#include "functions/function.hpp"
#include "kernels/kernels.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

constexpr int fine = 2;             // cells of the answer along one side of a cell
constexpr int fine_cells = fine * fine;
constexpr int pair_rows = comparison_cell / 2;  // rows of brightness in a cell
constexpr float surface_unit = 16.0f;  // px
constexpr float grey_unit = 64.0f;
constexpr float damping = 2.0f / (grey_unit * grey_unit);
constexpr float quiet = 1.0f / (grey_unit * grey_unit);
constexpr float log_share = 1.0f / 4.0f;
constexpr float largest_step = 2.0f;  // px
constexpr int small_reach = 1;
constexpr int large_reach = 3;
constexpr int hint_planes = 24;
constexpr int step_planes = fine_cells + 2;
constexpr int surface_reach = 2;  // cells within which the nearest and the farthest surface are looked for
constexpr int64_t most_cells = 1 << 26;

// Planes of means, one row of cells after the other.
struct Means {
  float* data;
  int rows;
  int cells;

  ptrdiff_t plane() const { return static_cast<ptrdiff_t>(rows) * cells; }
  float* row(int y) const { return data + static_cast<ptrdiff_t>(y) * cells; }
};

// One view pair of a batch and the memory of its comparison.
class Comparison {
 public:
  Comparison(float* scratch, int rows, int cells, const float* left, const float* right, const float* disparity, float unit)
      : rows_(rows), cells_(cells), left_(left), right_(right), disparity_(disparity), unit_(unit) {
    const auto take = [&](int down, int along, int planes) {
      Means means{scratch, down, along};
      scratch += planes * means.plane();
      return means;
    };
    fine_ = take(fine * rows, fine * cells, view_moments);
    coarse_ = take(rows, cells, view_moments);
    near_ = take(rows, cells, view_moments);
    far_ = take(rows, cells, view_moments);
    surfaces_[0] = take(rows, cells, 1);
    surfaces_[1] = take(rows, cells, 1);
  }

  static size_t scratch_values(int rows, int cells) {
    return static_cast<size_t>(rows) * static_cast<size_t>(cells) * (view_moments * (fine_cells + 3) + 2);
  }

  // The three steps, in this order. Each step must finish all rows of cells before the next step begins.
  void find_surfaces(int y, float* scratch) const;
  void compare(int y, float* scratch) const;
  void solve(int y, float* scratch, float* hints, float* steps, float* spread) const;

  static size_t row_scratch_values(int cells) {
    const int width = comparison_cell * cells;
    return static_cast<size_t>(
        std::max(CompareRow::scratch_values(width), SolveRow::scratch_values(fine * cells, large_reach) + 10 * cells));
  }

 private:
  void compare_at(const float* disparity, int y, int columns, const Means& means, float* scratch) const;
  void solve_row_of(const Means& means, int y, int reach, float* scratch, float* step, float* texture, float* mismatch) const;

  int rows_;
  int cells_;
  const float* left_;
  const float* right_;
  const float* disparity_;
  float unit_;
  Means fine_;
  Means coarse_;
  Means near_;
  Means far_;
  Means surfaces_[2];  // disparity of the nearest and of the farthest surface
};

void Comparison::find_surfaces(int y, float* scratch) const {
  find_extremes(disparity_, rows_, cells_, y, surface_reach, scratch, surfaces_[0].row(y), surfaces_[1].row(y));
}

void Comparison::compare_at(const float* disparity, int y, int columns, const Means& means, float* scratch) const {
  const int width = comparison_cell * cells_;
  const bool whole = columns == comparison_cell;
  for (int part = 0; part < pair_rows; ++part) {
    const ptrdiff_t row = static_cast<ptrdiff_t>(pair_rows) * y + part;
    CompareRow one;
    one.left = left_ + row * width;
    one.right = right_ + row * width;
    one.width = width;
    // The upper of the two rows of brightness lies a quarter of a cell above the middle of the cell, the lower one as much
    // below it.
    one.upper = disparity + std::max(y - 1 + part, 0) * cells_;
    one.lower = disparity + std::min(y + part, rows_ - 1) * cells_;
    one.lower_share = part == 0 ? 0.75f : 0.25f;
    one.columns = columns;
    one.share = 1.0f / static_cast<float>(columns * (whole ? pair_rows : 1));
    one.first = !whole || part == 0;
    one.scratch = scratch;
    for (int plane = 0; plane < view_moments; ++plane) {
      one.means[plane] = means.row(whole ? y : static_cast<int>(row)) + plane * means.plane();
    }
    kernels().compare_row(one);
  }
}

void Comparison::compare(int y, float* scratch) const {
  compare_at(disparity_, y, fine, fine_, scratch);
  compare_at(surfaces_[0].data, y, comparison_cell, near_, scratch);
  compare_at(surfaces_[1].data, y, comparison_cell, far_, scratch);
  for (int plane = 0; plane < view_moments; ++plane) {
    const float* upper = fine_.row(fine * y) + plane * fine_.plane();
    const float* lower = upper + fine_.cells;
    float* out = coarse_.row(y) + plane * coarse_.plane();
    for (int x = 0; x < cells_; ++x) {
      out[x] = ((upper[2 * x] + upper[2 * x + 1]) + (lower[2 * x] + lower[2 * x + 1])) * 0.25f;
    }
  }
}

void Comparison::solve_row_of(const Means& means, int y, int reach, float* scratch, float* step, float* texture,
                              float* mismatch) const {
  SolveRow one;
  one.count = 0;
  for (int j = std::max(y - reach, 0); j <= std::min(y + reach, means.rows - 1); ++j) one.rows[one.count++] = means.row(j);
  one.plane_stride = means.plane();
  one.cells = means.cells;
  one.reach = reach;
  float* share = scratch;
  for (int x = 0; x < means.cells; ++x) {
    const int columns = std::min(x + reach, means.cells - 1) - std::max(x - reach, 0) + 1;
    share[x] = 1.0f / static_cast<float>(columns * one.count);
  }
  one.share = share;
  one.damping = damping;
  one.quiet = quiet;
  one.log_share = log_share;
  one.largest_step = largest_step;
  one.scratch = scratch + means.cells;
  one.step = step;
  one.texture = texture;
  one.mismatch = mismatch;
  kernels().solve_row(one);
}

void Comparison::solve(int y, float* scratch, float* hints, float* steps, float* spread) const {
  const ptrdiff_t plane = coarse_.plane();
  const ptrdiff_t row = static_cast<ptrdiff_t>(y) * cells_;
  // Results of the windows on the finer grid; its four cells in a cell become channels.
  float* fine_row[3] = {scratch, scratch + fine * cells_, scratch + 2 * fine * cells_};
  float* unwanted = scratch + 3 * fine * cells_;
  float* rest = unwanted + 2 * cells_;
  for (int part = 0; part < fine; ++part) {
    solve_row_of(fine_, fine * y + part, small_reach, rest, fine_row[0], fine_row[1], fine_row[2]);
    for (int i = 0; i < 3; ++i) {
      float* even = hints + (i * fine_cells + part * fine) * plane + row;
      float* odd = even + plane;
      for (int x = 0; x < cells_; ++x) {
        even[x] = fine_row[i][2 * x];
        odd[x] = fine_row[i][2 * x + 1];
      }
    }
  }
  float* next = hints + 3 * fine_cells * plane + row;
  const auto take = [&] {
    float* taken = next;
    next += plane;
    return taken;
  };
  float* small_step = take();
  float* small_texture = take();
  solve_row_of(coarse_, y, small_reach, rest, small_step, spread + row, spread + plane + row);
  std::memcpy(small_texture, spread + row, sizeof(float) * static_cast<size_t>(cells_));
  solve_row_of(coarse_, y, large_reach, rest, take(), unwanted, unwanted + cells_);
  const float* disparity = disparity_ + row;
  float* own = take();
  for (int x = 0; x < cells_; ++x) own[x] = disparity[x] / unit_;
  for (int i = 0; i < 2; ++i) {
    const float* surface = surfaces_[i].row(y);
    float* apart = take();
    for (int x = 0; x < cells_; ++x) apart[x] = (surface[x] - disparity[x]) / surface_unit;
    float* step = take();
    float* texture = take();
    solve_row_of(i == 0 ? near_ : far_, y, small_reach, rest, step, texture, take());
    std::memcpy(steps + (fine_cells + i) * plane + row, surface, sizeof(float) * static_cast<size_t>(cells_));
  }
  for (int i = 0; i < fine_cells; ++i) {
    std::memcpy(steps + i * plane + row, hints + i * plane + row, sizeof(float) * static_cast<size_t>(cells_));
  }
}

class CompareViews : public Function {
 public:
  explicit CompareViews(float unit) : unit_(unit) {}

  void compute(FunctionCall& call) override {
    const Shape shape = call.shape(1);
    check_shape("disparity", shape, {-1, 1, -1, -1});
    const int64_t count = shape[0];
    const int rows = static_cast<int>(shape[2]);
    const int cells = static_cast<int>(shape[3]);
    const int64_t view = int64_t{pair_rows} * rows * comparison_cell * cells;
    check_shape("bright", call.shape(0), {2 * count, 1, int64_t{pair_rows} * rows, int64_t{comparison_cell} * cells});
    float* hints = call.float_output(0, {count, hint_planes, rows, cells});
    float* steps = call.float_output(1, {count, step_planes, rows, cells});
    float* spread = call.float_output(2, {count, 2, rows, cells});
    if (rows == 0 || cells == 0) return;
    require(int64_t{rows} * cells <= most_cells, ENDO_INFERENCE_FAILED, "disparity", Text("must have at most ", most_cells, " cells"),
            int64_t{rows} * cells);
    Scratch::Lent memory(scratch_, Comparison::scratch_values(rows, cells));
    for (int64_t i = 0; i < count; ++i) {
      const int64_t plane = int64_t{rows} * cells;
      const Comparison comparison(memory.data(), rows, cells, call.floats(0) + i * view, call.floats(0) + (count + i) * view,
                                  call.floats(1) + i * plane, unit_);
      const auto each_row = [&](const auto& body) {
        for_each_row(call, row_scratch_, rows, Comparison::row_scratch_values(cells), body);
      };
      each_row([&](int y, float* own) { comparison.find_surfaces(y, own); });
      each_row([&](int y, float* own) { comparison.compare(y, own); });
      each_row([&](int y, float* own) {
        comparison.solve(y, own, hints + i * hint_planes * plane, steps + i * step_planes * plane, spread + i * 2 * plane);
      });
    }
  }

 private:
  float unit_;
  Scratch scratch_;
  Scratch row_scratch_;
};

}  // namespace

std::unique_ptr<Function> make_compare_views(const FunctionSettings& settings) {
  return std::make_unique<CompareViews>(positive_setting(settings, "unit"));
}

}  // namespace endosdk
