#include "maps/glare_rows.hpp"

#include <algorithm>

#include "maps/reasons.hpp"

namespace endosdk {
namespace {

int nearest(int position, double scale, int size) {
  return std::min(static_cast<int>((position + 0.5) * scale), size - 1);
}

// Writes the least of the three channels for each pixel, and returns the largest of these.
uint8_t least_of_channels(const PlanarView& view, int y, uint8_t* __restrict out) {
  const uint8_t* red = view.row(0, y);
  const uint8_t* green = view.row(1, y);
  const uint8_t* blue = view.row(2, y);
  uint8_t most = 0;
  for (int x = 0; x < view.width; ++x) {
    const uint8_t two = red[x] < green[x] ? red[x] : green[x];
    const uint8_t least = two < blue[x] ? two : blue[x];
    most = most < least ? least : most;
    out[x] = least;
  }
  return most;
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
  latest_.assign(static_cast<size_t>(workers), {-1, false});  // another picture
}

const uint8_t* GlareRows::row(const PlanarView& view, int y, int worker) {
  uint8_t* const seen = rows_.data() + static_cast<size_t>(view.width + out_width_) * static_cast<size_t>(worker);
  uint8_t* const wide = seen + view.width;
  const int source_y = columns_.empty() ? y : nearest(y, scale_.y, view.height);
  Latest& latest = latest_[static_cast<size_t>(worker)];
  if (latest.y != source_y) {  // several output rows lie on one row of the view
    latest = {source_y, least_of_channels(view, source_y, seen) >= saturation_level};
    if (latest.saturated && !columns_.empty()) {
      // Local copies: the compiler must assume that the byte writes change the members.
      const int* const columns = columns_.data();
      const int width = out_width_;
      for (int x = 0; x < width; ++x) wide[x] = seen[columns[x]];
    }
  }
  if (!latest.saturated) return nullptr;
  return columns_.empty() ? seen : wide;
}

}  // namespace endosdk
