#include "glare_rows.hpp"

#include <algorithm>

namespace endosdk {
namespace {

int nearest(int position, double scale, int size) {
  return std::min(static_cast<int>((position + 0.5) * scale), size - 1);
}

void least_of_channels(const PlanarView& view, int y, uint8_t* out) {
  const uint8_t* red = view.row(0, y);
  const uint8_t* green = view.row(1, y);
  const uint8_t* blue = view.row(2, y);
  for (int x = 0; x < view.width; ++x) {
    const uint8_t least = red[x] < green[x] ? red[x] : green[x];
    out[x] = least < blue[x] ? least : blue[x];
  }
}

}  // namespace

void GlareRows::prepare(const PlanarView& view, int out_width, Scale scale, int workers) {
  const bool same = scale.x == 1.0 && scale.y == 1.0;
  if (!same && (out_width != out_width_ || scale.x != scale_.x || columns_.empty())) {
    columns_.resize(out_width);
    for (int x = 0; x < out_width; ++x) columns_[x] = nearest(x, scale.x, view.width);
  }
  if (same) columns_.clear();
  scale_ = scale;
  out_width_ = out_width;
  const size_t needed = static_cast<size_t>(view.width + out_width) * static_cast<size_t>(workers);
  if (rows_.size() < needed) rows_.resize(needed);
  latest_.assign(static_cast<size_t>(workers), -1);  // another picture
}

const uint8_t* GlareRows::row(const PlanarView& view, int y, int worker) {
  uint8_t* const seen = rows_.data() + static_cast<size_t>(view.width + out_width_) * static_cast<size_t>(worker);
  uint8_t* const wide = seen + view.width;
  const uint8_t* const result = columns_.empty() ? seen : wide;
  const int source_y = columns_.empty() ? y : nearest(y, scale_.y, view.height);
  int& latest = latest_[static_cast<size_t>(worker)];
  if (latest == source_y) return result;  // several output rows lie on one row of the view
  latest = source_y;
  least_of_channels(view, source_y, seen);
  if (!columns_.empty()) {
    for (int x = 0; x < out_width_; ++x) wide[x] = seen[columns_[x]];
  }
  return result;
}

}  // namespace endosdk
