#include "reduce.hpp"

#include <algorithm>

#include "kernels/kernels.hpp"
#include "threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 8;
constexpr int largest_factor = 16;  // the sum of 16 x 16 bytes fits 16 bits

}  // namespace

int reduction(Size raw, Size picture) {
  return std::clamp(std::min(raw.width / picture.width, raw.height / picture.height), 1, largest_factor);
}

Size reduced_size(Size raw, int factor) { return {raw.width / factor, raw.height / factor}; }

ImageView reduce(const ImageView& source, int factor, std::vector<uint8_t>& pixels) {
  const Size size = reduced_size({source.width, source.height}, factor);
  const Reduction row = {factor, source.channels, size.width};
  const ptrdiff_t stride = ptrdiff_t{size.width} * source.channels;
  pixels.resize(static_cast<size_t>(stride) * static_cast<size_t>(size.height));
  parallel_for(size.height, rows_per_block, [&](int begin, int end, int) {
    thread_local std::vector<uint16_t> scratch;  // kept between frames
    scratch.resize(static_cast<size_t>(row.scratch()));
    for (int y = begin; y < end; ++y) {
      kernels().reduce_row(source.row(y * factor), source.stride, row, scratch.data(), pixels.data() + y * stride);
    }
  });
  return {pixels.data(), size.width, size.height, source.channels, stride};
}

}  // namespace endosdk
