// Prepares the inputs of networks from both views: the pixels, with the colours side by side, and the brightness of pairs of
// rows.
#include <algorithm>

#include "functions/function.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr int cell = 4;                     // pixels that lie side by side as channels
constexpr float unit = 64.0f;               // grey levels that become 1
constexpr float share = 1.0f / (6 * unit);  // weight of each value: three channels of two rows are averaged
constexpr int block = 16;                   // pairs of rows at a time
constexpr int seen = 3;                     // pixels of a smaller view per `whole` pixels of the view
constexpr int whole = 4;

// Both views of a batch, and their number and size.
struct Views {
  const uint8_t* views[2];
  int64_t count;
  int64_t height;
  int64_t width;

  // One channel of a view. Views are numbered over the batch, left views first.
  const uint8_t* channel(int64_t view, int c) const {
    return views[view / count] + (view % count * 3 + c) * height * width;
  }
};

Views views_of(const FunctionCall& call, int64_t rows, int64_t columns) {
  const Shape shape = call.shape(0);
  check_shape("left", shape, {-1, 3, -1, -1});
  check_shape("right", call.shape(1), shape);
  check_shape("left", shape, {shape[0], 3, shape[2] / rows * rows, shape[3] / columns * columns});
  return {{call.bytes(0), call.bytes(1)}, shape[0], shape[2], shape[3]};
}

// Calls `body(view, pair)` for all pairs of rows of all views.
template <typename Body>
void for_pairs(FunctionCall& call, int64_t views, int64_t pairs, const Body& body) {
  const int64_t blocks = (pairs + block - 1) / block;
  call.parallel(views * blocks, [&](int index) {
    const int64_t first = index % blocks * block;
    for (int64_t pair = first; pair < std::min(first + block, pairs); ++pair) body(index / blocks, pair);
  });
}

class ReadViews : public Function {
 public:
  void compute(FunctionCall& call) override {
    const Views views = views_of(call, 2, cell);
    const int64_t width = views.width;
    const int64_t pairs = views.height / 2;
    auto* rows = static_cast<uint8_t*>(call.output(0, {2 * views.count, views.height, width / cell, 3 * cell}));
    float* bright = call.float_output(1, {2 * views.count, 1, pairs, width});
    for_pairs(call, 2 * views.count, pairs, [&](int64_t view, int64_t pair) {
      const uint8_t* channel[3];
      for (int c = 0; c < 3; ++c) channel[c] = views.channel(view, c) + 2 * pair * width;
      const int count = static_cast<int>(width);
      for (int64_t y = 0; y < 2; ++y) {
        uint8_t* out = rows + (view * views.height + 2 * pair + y) * 3 * width;
        kernels().interleave_row(channel[0] + y * width, channel[1] + y * width, channel[2] + y * width, count, out);
      }
      kernels().pair_brightness(channel, width, count, share, bright + (view * pairs + pair) * width);
    });
  }
};

class ReadSmaller : public Function {
 public:
  void compute(FunctionCall& call) override {
    const Views views = views_of(call, 2 * whole, whole * cell);
    const int64_t height = views.height / whole * seen;
    const int64_t width = views.width / whole * seen;
    float* rows = call.float_output(0, {2 * views.count, height, width / cell, 3 * cell});
    float* bright = call.float_output(1, {2 * views.count, 1, height / 2, width});
    for_pairs(call, 2 * views.count, height / 2, [&](int64_t view, int64_t pair) {
      for (int64_t y = 2 * pair; y < 2 * pair + 2; ++y) {
        // The three rows of the smaller view lie 1/6, 3/2 and 17/6 rows after the first of four rows.
        constexpr float shares[seen] = {1.0f / 6.0f, 0.5f, 5.0f / 6.0f};
        SmallerRow row;
        for (int c = 0; c < 3; ++c) {
          row.upper[c] = views.channel(view, c) + (y / seen * whole + y % seen) * views.width;
          row.lower[c] = row.upper[c] + views.width;
        }
        row.lower_share = shares[y % seen];
        row.groups = static_cast<int>(views.width / whole);
        row.pixels = rows + (view * height + y) * 3 * width;
        row.share = share;
        row.first = y % 2 == 0;
        row.bright = bright + (view * (height / 2) + pair) * width;
        kernels().smaller_row(row);
      }
    });
  }
};

}  // namespace

std::unique_ptr<Function> make_read_views(const FunctionSettings&) { return std::make_unique<ReadViews>(); }

std::unique_ptr<Function> make_read_smaller(const FunctionSettings&) { return std::make_unique<ReadSmaller>(); }

}  // namespace endosdk
