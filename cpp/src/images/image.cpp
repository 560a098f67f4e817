#include "images/image.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "platform/errors.hpp"
#include "kernels/kernels.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 16;

void pack_row(const ImageView& image, const PlanarView& out, ChannelOrder order, int y) {
  const PlaneRows rows(out, order, y);
  if (order == ChannelOrder::gray) {
    for (uint8_t* plane : rows.channel) std::memcpy(plane, image.row(y), image.width);
  } else {
    kernels().split_rgb(image.row(y), image.width, rows.channel[0], rows.channel[1], rows.channel[2]);
  }
  pad_right(out, image.width, y);
}

}  // namespace

PlaneRows::PlaneRows(const PlanarView& out, ChannelOrder order, int y)
    : channel{out.row(0, y), out.row(1, y), out.row(2, y)} {
  if (order == ChannelOrder::bgr) {
    channel[0] = out.row(2, y);
    channel[2] = out.row(0, y);
  }
}

void copy_interleaved(const PlanarView& from, Size size, uint8_t* to) {
  if (to == nullptr) return;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (int plane = 0; plane < 3; ++plane) *to++ = from.row(plane, y)[x];
    }
  }
}

void check_source(const ImageView& image, ChannelOrder order, const char* name) {
  const int channels = order == ChannelOrder::gray ? 1 : 3;
  require(image.channels == channels, name, Text("must have ", channels, " channels for this order"),
          image.channels);
  require(image.width >= 1 && image.height >= 1, name, "must not be empty", image.size());
  const int64_t pitch = std::llabs(static_cast<long long>(image.stride));
  require(pitch >= static_cast<int64_t>(image.width) * channels || image.height == 1, name, "rows must not overlap",
          image.stride);
  // The vector kernels hold byte offsets in 32 bits.
  require(pitch * image.height <= std::numeric_limits<int32_t>::max(), name, "must span less than 2 GiB",
          pitch * image.height);
}

void check_planar(const PlanarView& out, int min_width, int min_height, const char* name) {
  require(out.width >= min_width && out.height >= min_height, name,
          Text("must be at least ", Size{min_width, min_height}), out.size());
}

void pad_right(const PlanarView& out, int width, int y) {
  for (int plane = 0; plane < 3; ++plane) {
    uint8_t* row = out.row(plane, y);
    std::memset(row + width, row[width - 1], (out.width - width));
  }
}

void pad_bottom(const PlanarView& out, int height) {
  for (int plane = 0; plane < 3; ++plane) {
    for (int y = height; y < out.height; ++y) {
      std::memcpy(out.row(plane, y), out.row(plane, height - 1), out.width);
    }
  }
}

void pack(const ImageView& left, const ImageView& right, const PlanarView& out_left, const PlanarView& out_right,
          ChannelOrder order) {
  check_source(left, order, "left");
  check_source(right, order, "right");
  require(left.size() == right.size(), "right", "must have the size of left", right.size());
  check_planar(out_left, left.width, left.height, "out_left");
  check_planar(out_right, left.width, left.height, "out_right");
  parallel_for(2 * left.height, rows_per_block, [&](int begin, int end, int) {
    for (int i = begin; i < end; ++i) {
      const bool second = i >= left.height;
      const int y = second ? i - left.height : i;
      pack_row(second ? right : left, second ? out_right : out_left, order, y);
      if (y == left.height - 1) pad_bottom(second ? out_right : out_left, left.height);
    }
  });
}

}  // namespace endosdk
