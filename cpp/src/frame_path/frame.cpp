#include "frame_path/frame.hpp"

#include <limits>

#include "platform/errors.hpp"

namespace endosdk {

void check_pair(const FramePair& pair) {
  const ImageView& l = pair.left;
  const ImageView& r = pair.right;
  require(l.width > 0 && l.height > 0, "left", "must be at least 1x1", Text(l.width, "x", l.height));
  const bool fits = int64_t{l.width} * l.height <= std::numeric_limits<int32_t>::max() / 3;
  require(fits, "left", "a frame must take less than 2 GiB", Text(l.width, "x", l.height));
  require(l.width == r.width && l.height == r.height, "right", Text("must have the size of left, ", l.width, "x", l.height),
          Text(r.width, "x", r.height));
  require(l.channels == r.channels, "right", Text("must have as many channels as left, ", l.channels), r.channels);
  check_source(l, pair.order, "left");
  check_source(r, pair.order, "right");
  const int64_t now = now_ns();
  require(pair.stamp_ns >= 0 && pair.stamp_ns <= now, "stamp_ns",
          Text("must be of the monotonic clock, and at most now, ", now), pair.stamp_ns);
}

}  // namespace endosdk
