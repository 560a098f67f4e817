#include "frame_path/frame.hpp"

#include <limits>

#include "platform/errors.hpp"

namespace endosdk {

void check_frame_size(Size size, const char* argument) {
  const auto known = [](int side) { return side > 0 && side <= longest_side; };
  const bool fits = known(size.width) && known(size.height) && int64_t{size.width} * size.height <= std::numeric_limits<int32_t>::max() / 3;
  require(fits, argument, Text("must be 1x1 to ", longest_side, "x", longest_side, " and a frame less than 2 GiB"),
          size);
}

void check_pair(const FramePair& pair) {
  const ImageView& l = pair.left;
  const ImageView& r = pair.right;
  check_frame_size(pair.size(), "left");
  require(l.size() == r.size(), "right", Text("must have the size of left, ", l.size()), r.size());
  require(l.channels == r.channels, "right", Text("must have as many channels as left, ", l.channels), r.channels);
  check_source(l, pair.order, "left");
  check_source(r, pair.order, "right");
  const int64_t now = now_ns();
  require(pair.stamp_ns >= 0 && pair.stamp_ns <= now, "stamp_ns",
          Text("must be of the monotonic clock, and at most now, ", now), pair.stamp_ns);
}

}  // namespace endosdk
