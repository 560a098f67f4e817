#include "images/rectify.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "platform/errors.hpp"
#include "kernels/kernels.hpp"
#include "kernels/sample.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

// A map that leaves a view as it is may miss the outermost pixels by rounding.
constexpr double rounding_px = 1e-6;

constexpr int rows_per_block = 16;
constexpr int steps_per_pixel = 128;  // resolution of a stored position

void check_size(Size size, const char* name) {
  require(size.width >= 1 && size.height >= 1 && size.width <= longest_side && size.height <= longest_side, name,
          Text("must be 1x1 to ", Size{longest_side, longest_side}), size);
}

int checked_reduction(Size raw, Size rectified) {
  check_size(raw, "size");
  check_size(rectified, "out size");
  return reduction(raw, rectified);
}

// Builds the map from a reduced frame. Its camera has proportionally shorter focal lengths, and its first pixel lies in the
// middle of the first block.
ViewMap build(const ViewGeometry& view, Size raw, Size rectified, int factor, Border border, const char* name) {
  check_view(view, name);
  ViewGeometry seen = view;
  const double middle = 0.5 * (factor - 1);
  seen.camera.fx /= factor;
  seen.camera.fy /= factor;
  seen.camera.cx = (view.camera.cx - middle) / factor;
  seen.camera.cy = (view.camera.cy - middle) / factor;
  const MapSource source = {reduced_size(raw, factor), static_cast<double>(raw.width) / factor,
                            static_cast<double>(raw.height) / factor, factor > 1 ? Border::whole : border};
  return {seen, source, rectified};
}

int pixel_or_black(const ImageView& image, int x, int y, int channel) {
  if (x < 0 || y < 0 || x >= image.width || y >= image.height) return 0;
  return image.row(y)[static_cast<ptrdiff_t>(x) * image.channels + channel];
}

// Whether the source position lies inside an image of this size, and the lens model is one-to-one there.
bool is_valid(const SourceMap::Source& found, Size size) {
  const Point p = found.pixel;
  return found.unfolded && p.x >= -rounding_px && p.y >= -rounding_px && p.x <= size.width - 1.0 + rounding_px &&
         p.y <= size.height - 1.0 + rounding_px;
}

}  // namespace

std::vector<uint8_t> valid_pixels(const ViewGeometry& view, Size raw, Size rectified) {
  std::vector<uint8_t> valid(count_of(rectified));
  const SourceMap map(view);
  parallel_for(rectified.height, rows_per_block, [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      uint8_t* const row = valid.data() + static_cast<ptrdiff_t>(y) * rectified.width;
      for (int x = 0; x < rectified.width; ++x) row[x] = is_valid(map.at(x, y), raw);
    }
  });
  return valid;
}

ViewMap::ViewMap(const ViewGeometry& view, const MapSource& source, Size rectified) : size_(rectified) {
  const size_t pixels = rectified.width * rectified.height;
  corner_.resize(pixels);
  fraction_.resize(pixels);
  valid_.resize(pixels);
  const SourceMap map(view);
  // Only this part runs in parallel: it allocates nothing, so it cannot throw.
  std::vector<Kind> kinds(pixels);
  parallel_for(rectified.height, rows_per_block, [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) build_row(map, source, y, kinds.data());
  });
  row_spans_.reserve(static_cast<size_t>(rectified.height) + 1);
  row_spans_.push_back(0);
  for (int y = 0; y < rectified.height; ++y) {
    const Kind* const row = kinds.data() + y * rectified.width;
    for (int x = 0; x < rectified.width; ++x) {
      if (x == 0 || row[x] != row[x - 1]) spans_.push_back({x, x, row[x]});
      spans_.back().end = x + 1;
    }
    row_spans_.push_back(spans_.size());
  }
}

// Stores one source position, and returns how it must be read.
ViewMap::Kind ViewMap::place(Point position, const MapSource& source, size_t index) {
  const Size size = source.size;
  const double rim = source.border == Border::whole ? 0.5 : 1.0;
  const bool near = position.x > -rim && position.y > -rim && position.x < source.width - 1.0 + rim &&
                    position.y < source.height - 1.0 + rim;
  if (!near) return Kind::outside;  // also NaN
  if (source.border == Border::whole) {
    position.x = std::clamp(position.x, 0.0, size.width - 1.0);
    position.y = std::clamp(position.y, 0.0, size.height - 1.0);
  }
  const int x = static_cast<int>(std::lround(position.x * steps_per_pixel));
  const int y = static_cast<int>(std::lround(position.y * steps_per_pixel));
  const int x0 = x >> 7;
  const int y0 = y >> 7;
  corner_[index] = static_cast<uint32_t>(x0 & 0xffff) | static_cast<uint32_t>(y0 & 0xffff) << 16;
  fraction_[index] = static_cast<uint16_t>((x & 0x7f) | (y & 0x7f) << 8);
  const bool inside = x0 >= 0 && y0 >= 0 && x0 + remap_reach <= size.width && y0 + 1 < size.height;
  return inside ? Kind::inside : Kind::edge;
}

void ViewMap::build_row(const SourceMap& map, const MapSource& source, int y, Kind* kinds) {
  for (int x = 0; x < size_.width; ++x) {
    const size_t index = y * size_.width + x;
    const SourceMap::Source found = map.at(x, y);
    valid_[index] = is_valid(found, source.size);
    kinds[index] = place(found.pixel, source, index);
  }
}

void ViewMap::remap_edge(const ImageView& source, size_t row, Span span, uint8_t* const planes[3]) const {
  for (int x = span.begin; x < span.end; ++x) {
    const size_t index = row + x;
    const int x0 = static_cast<int16_t>(corner_[index] & 0xffff);
    const int y0 = static_cast<int16_t>(corner_[index] >> 16);
    for (int channel = 0; channel < source.channels; ++channel) {
      planes[channel][x] = sample(pixel_or_black(source, x0, y0, channel), pixel_or_black(source, x0 + 1, y0, channel),
                                  pixel_or_black(source, x0, y0 + 1, channel),
                                  pixel_or_black(source, x0 + 1, y0 + 1, channel), fraction_[index] & 0xff,
                                  fraction_[index] >> 8);
    }
  }
}

void ViewMap::rectify_row(const ImageView& source, ChannelOrder order, int y, const PlanarView& out) const {
  const PlaneRows rows(out, order, y);
  const size_t row = y * size_.width;
  const bool gray = order == ChannelOrder::gray;
  for (size_t i = row_spans_[y]; i < row_spans_[y + 1]; ++i) {
    const Span span = spans_[i];
    const int count = span.end - span.begin;
    const size_t first = row + span.begin;
    const RemapSpan positions = {corner_.data() + first, fraction_.data() + first, count};
    uint8_t* const planes[3] = {rows.channel[0] + span.begin, rows.channel[1] + span.begin,
                                rows.channel[2] + span.begin};
    if (span.kind == Kind::outside) {
      for (uint8_t* plane : planes) std::memset(plane, 0, count);
    } else if (span.kind == Kind::edge) {
      remap_edge(source, row, span, rows.channel);
    } else if (gray) {
      kernels().remap_gray(source.data, source.stride, positions, planes[0]);
    } else {
      kernels().remap_rgb(source.data, source.stride, positions, planes[0], planes[1], planes[2]);
    }
  }
  if (gray) {
    std::memcpy(rows.channel[1], rows.channel[0], size_.width);
    std::memcpy(rows.channel[2], rows.channel[0], size_.width);
  }
  pad_right(out, size_.width, y);
}

Rectifier::Rectifier(Size raw, Size rectified, const ViewGeometry& left, const ViewGeometry& right, Border border)
    : raw_(raw),
      rectified_(rectified),
      factor_(checked_reduction(raw, rectified)),
      left_(build(left, raw, rectified, factor_, border, "left")),
      right_(build(right, raw, rectified, factor_, border, "right")) {}

void Rectifier::rectify(const ImageView& left, const ImageView& right, const PlanarView& out_left,
                        const PlanarView& out_right, ChannelOrder order, RectifyScratch& scratch) const {
  const auto check = [&](const ImageView& image, const char* name) {
    check_source(image, order, name);
    require(image.size() == raw_, name, Text("must be ", raw_), image.size());
  };
  check(left, "left");
  check(right, "right");
  check_planar(out_left, rectified_.width, rectified_.height, "out_left");
  check_planar(out_right, rectified_.width, rectified_.height, "out_right");
  const bool is_large = factor_ > 1;
  const ImageView seen_left = is_large ? reduce(left, factor_, scratch.left) : left;
  const ImageView seen_right = is_large ? reduce(right, factor_, scratch.right) : right;
  const int height = rectified_.height;
  parallel_for(2 * height, rows_per_block, [&](int begin, int end, int) {
    for (int i = begin; i < end; ++i) {
      const bool second = i >= height;
      const int y = second ? i - height : i;
      const PlanarView& out = second ? out_right : out_left;
      (second ? right_ : left_).rectify_row(second ? seen_right : seen_left, order, y, out);
      if (y == height - 1) pad_bottom(out, height);
    }
  });
}

}  // namespace endosdk
