#include "maps/field_rows.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

// Smaller shares of a cell count as 0.
constexpr float least_share = 0.001f;

// The two cells between whose centres an output pixel lies, or one cell if the pixel lies on its centre.
FieldOfView::Extent cells_around(int out, double scale, int size) {
  const auto place = std::clamp(static_cast<float>((out + 0.5) * scale - 0.5), 0.0f, static_cast<float>(size - 1));
  return {static_cast<int>(std::floor(place + least_share)), static_cast<int>(std::ceil(place - least_share))};
}

}  // namespace

void FieldRows::prepare(const MatchedViews& views, const Overlays& overlays, int out_width, Scale scale, int workers) {
  width_ = out_width;
  scale_ = scale;
  overlays_ = &overlays;
  for (Side* side : {&left_, &right_}) {
    side->field = &views.field(side->view);
    side->rows.resize(static_cast<size_t>(out_width) * static_cast<size_t>(workers));
    const int cells = side->field->map().width;
    side->first.resize(static_cast<size_t>(cells + 1));
    side->end.resize(static_cast<size_t>(cells + 1));
    if (!side->field->is_part()) continue;
    std::fill(side->first.begin(), side->first.end(), out_width);
    std::fill(side->end.begin(), side->end.end(), 0);
    for (int x = out_width - 1; x >= 0; --x) side->first[static_cast<size_t>(cells_around(x, scale.x, cells).first)] = x;
    for (int x = 0; x < out_width; ++x) side->end[static_cast<size_t>(cells_around(x, scale.x, cells).last)] = x + 1;
    for (int c = cells - 1; c >= 0; --c) {
      int& first = side->first[static_cast<size_t>(c)];
      first = std::min(first, side->first[static_cast<size_t>(c + 1)]);
    }
    for (int c = 1; c < cells; ++c) {
      int& end = side->end[static_cast<size_t>(c)];
      end = std::max(end, side->end[static_cast<size_t>(c - 1)]);
    }
  }
}

const uint8_t* FieldRows::left(int y, int worker) { return row(left_, y, worker); }

const uint8_t* FieldRows::right(int y, int worker, const uint8_t* valid) {
  const uint8_t* const inside = row(right_, y, worker);
  if (inside == nullptr || valid == nullptr) return inside != nullptr ? inside : valid;
  uint8_t* const both = right_.rows.data() + static_cast<ptrdiff_t>(worker) * width_;
  // A local copy: the compiler must assume that the byte writes change the member, and would not vectorise the loop.
  const int width = width_;
  for (int x = 0; x < width; ++x) both[x] &= valid[x] != 0 ? 1 : 0;
  return both;
}

const uint8_t* FieldRows::row(Side& side, int y, int worker) {
  const Size cells = {side.field->map().width, side.field->map().height};
  const int cell_row = std::clamp(static_cast<int>((y + 0.5) * scale_.y), 0, cells.height - 1);
  const uint8_t* const covered = overlays_->row(side.view, cell_row);
  if (!side.field->is_part() && covered == nullptr) return nullptr;
  uint8_t* const inside = side.rows.data() + static_cast<ptrdiff_t>(worker) * width_;
  if (side.field->is_part()) {
    write_field(side, y, inside);
  } else {
    std::fill_n(inside, width_, uint8_t{1});
  }
  if (covered != nullptr) leave_out(covered, cells.width, inside);
  return inside;
}

// A pixel is inside if all cells around it are inside.
void FieldRows::write_field(const Side& side, int y, uint8_t* inside) const {
  const FieldOfView::Extent around = cells_around(y, scale_.y, side.field->map().height);
  const FieldOfView::Extent upper = side.field->extent(around.first, 0);
  const FieldOfView::Extent lower = side.field->extent(around.last, 0);
  const int first_cell = std::max(upper.first, lower.first);
  const int last_cell = std::min(upper.last, lower.last);
  std::fill_n(inside, width_, uint8_t{0});
  if (last_cell < first_cell) return;
  const int first = side.first[static_cast<size_t>(first_cell)];
  const int end = side.end[static_cast<size_t>(last_cell)];
  if (end > first) std::fill_n(inside + first, end - first, uint8_t{1});
}

// Pixels that lie in covered cells are outside.
void FieldRows::leave_out(const uint8_t* covered, int cells, uint8_t* inside) const {
  for (int x = 0; x < width_; ++x) {
    const int cell = std::min(static_cast<int>((x + 0.5) * scale_.x), cells - 1);
    if (covered[cell] != 0) inside[x] = 0;
  }
}

}  // namespace endosdk
