#include "images/reduce.hpp"

#include <algorithm>

#include "kernels/kernels.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 8;
constexpr int largest_factor = 16;  // the sum of 16 x 16 bytes fits 16 bits

// The mean of the part of a block that lies in the frame.
void reduce_block(const ImageView& source, int factor, int x, int y, uint8_t* out) {
  const int right = std::min((x + 1) * factor, source.width);
  const int bottom = std::min((y + 1) * factor, source.height);
  const int count = (right - x * factor) * (bottom - y * factor);
  for (int channel = 0; channel < source.channels; ++channel) {
    int sum = count / 2;
    for (int v = y * factor; v < bottom; ++v) {
      for (int u = x * factor; u < right; ++u) sum += source.row(v)[u * source.channels + channel];
    }
    out[channel] = static_cast<uint8_t>(sum / count);
  }
}

}  // namespace

int reduction(Size raw, Size picture) {
  return std::clamp(std::min(raw.width / picture.width, raw.height / picture.height), 1, largest_factor);
}

Size reduced_size(Size raw, int factor) {
  return {(raw.width + factor - 1) / factor, (raw.height + factor - 1) / factor};
}

ImageView reduce(const ImageView& source, int factor, ReducedFrame& out) {
  const Size size = reduced_size({source.width, source.height}, factor);
  const Size whole = {source.width / factor, source.height / factor};  // complete blocks
  const Reduction row = {factor, source.channels, whole.width};
  const ptrdiff_t stride = ptrdiff_t{size.width} * source.channels;
  const int workers = thread_count();
  const size_t sums = static_cast<size_t>(row.scratch());
  out.pixels.resize(static_cast<size_t>(stride) * static_cast<size_t>(size.height));
  out.sums.resize(sums * static_cast<size_t>(workers));
  const auto reduce_rows = [&](int begin, int end, int worker) {
    for (int y = begin; y < end; ++y) {
      uint8_t* const to = out.pixels.data() + y * stride;
      int done = 0;
      if (y < whole.height && whole.width > 0) {
        kernels().reduce_row(source.row(y * factor), source.stride, row, out.sums.data() + static_cast<size_t>(worker) * sums, to);
        done = whole.width;
      }
      for (int x = done; x < size.width; ++x) reduce_block(source, factor, x, y, to + x * source.channels);
    }
  };
  parallel_for(size.height, rows_per_block, reduce_rows, workers);
  return {out.pixels.data(), size.width, size.height, source.channels, stride};
}

}  // namespace endosdk
