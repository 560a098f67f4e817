#include "colour_rows.hpp"

#include <algorithm>

namespace endosdk {
namespace {

int nearest(int position, double scale, int size) {
  return std::min(static_cast<int>((position + 0.5) * scale), size - 1);
}

}  // namespace

void ColourRows::prepare(const PlanarView& view, int out_width, Scale scale, int workers) {
  const bool same = scale.x == 1.0 && scale.y == 1.0;
  if (!same && (out_width != out_width_ || scale.x != scale_.x || columns_.empty())) {
    columns_.resize(out_width);
    for (int x = 0; x < out_width; ++x) columns_[x] = nearest(x, scale.x, view.width);
  }
  if (same) columns_.clear();
  scale_ = scale;
  out_width_ = out_width;
  const size_t needed = same ? 0 : size_t{3} * out_width * workers;
  if (rows_.size() < needed) rows_.resize(needed);
}

std::array<const uint8_t*, 3> ColourRows::row(const PlanarView& view, int y, int worker) {
  std::array<const uint8_t*, 3> planes{};
  const int source_y = columns_.empty() ? y : nearest(y, scale_.y, view.height);
  for (int plane = 0; plane < 3; ++plane) {
    const uint8_t* source = view.row(plane, source_y);
    planes[plane] = source;
    if (columns_.empty()) continue;
    uint8_t* out = rows_.data() + (size_t{3} * worker + plane) * out_width_;
    for (int x = 0; x < out_width_; ++x) out[x] = source[columns_[x]];
    planes[plane] = out;
  }
  return planes;
}

}  // namespace endosdk
