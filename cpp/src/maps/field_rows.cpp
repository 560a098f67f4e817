#include "maps/field_rows.hpp"

namespace endosdk {
namespace {

constexpr float wholly = 0.999f;

}  // namespace

void FieldRows::prepare(const FieldOfView& left, const FieldOfView& right, int out_width, Scale scale) {
  width_ = out_width;
  left_.field = &left;
  right_.field = &right;
  for (Side* side : {&left_, &right_}) {
    const FloatView map = side->field->map();
    side->resizer.prepare(map.width, map.height, out_width, scale);
    const size_t needed = static_cast<size_t>(out_width) * static_cast<size_t>(side->resizer.workers());
    side->rows.resize(needed);
    values_.resize(needed);
  }
}

const uint8_t* FieldRows::left(int y, int worker) { return row(left_, y, worker); }

const uint8_t* FieldRows::right(int y, int worker, const uint8_t* valid) {
  const uint8_t* const inside = row(right_, y, worker);
  if (inside == nullptr || valid == nullptr) return inside != nullptr ? inside : valid;
  uint8_t* const both = right_.rows.data() + static_cast<ptrdiff_t>(worker) * width_;
  for (int x = 0; x < width_; ++x) both[x] &= valid[x] != 0 ? 1 : 0;
  return both;
}

const uint8_t* FieldRows::row(Side& side, int y, int worker) {
  if (!side.field->is_part()) return nullptr;
  float* const values = values_.data() + static_cast<ptrdiff_t>(worker) * width_;
  uint8_t* const inside = side.rows.data() + static_cast<ptrdiff_t>(worker) * width_;
  side.resizer.row(side.field->map(), y, 1.0f, worker, values);
  for (int x = 0; x < width_; ++x) inside[x] = values[x] >= wholly ? 1 : 0;
  return inside;
}

}  // namespace endosdk
