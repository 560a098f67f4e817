#include "reduce.hpp"

#include <algorithm>

#include "threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 8;
constexpr int largest_factor = 16;  // 16 x 16 x 255 fits 16 bits

// Sums of `factor` rows, value by value; a loop that compilers turn into vector code.
void add_rows(const ImageView& source, int first, int factor, uint16_t* sums) {
  const int values = source.width * source.channels;
  const uint8_t* upper = source.row(first);
  for (int i = 0; i < values; ++i) sums[i] = upper[i];
  for (int k = 1; k < factor; ++k) {
    const uint8_t* row = source.row(first + k);
    for (int i = 0; i < values; ++i) sums[i] = static_cast<uint16_t>(sums[i] + row[i]);
  }
}

// Means over blocks of `factor` pixels of one row of sums.
template <int channels>
void mean_of_blocks(const uint16_t* sums, int width, int factor, uint8_t* out) {
  const uint32_t count = static_cast<uint32_t>(factor) * static_cast<uint32_t>(factor);
  // Division by a constant as a multiplication: exact for sums below 2^16 and counts up to 256.
  const uint32_t reciprocal = (uint32_t{1} << 24) / count + 1;
  for (int x = 0; x < width; ++x, sums += factor * channels, out += channels) {
    for (int c = 0; c < channels; ++c) {
      uint32_t sum = count / 2;
      for (int k = 0; k < factor; ++k) sum += sums[k * channels + c];
      out[c] = static_cast<uint8_t>(uint64_t{sum} * reciprocal >> 24);
    }
  }
}

}  // namespace

int reduction(Size raw, Size picture) {
  return std::clamp(std::min(raw.width / picture.width, raw.height / picture.height), 1, largest_factor);
}

Size reduced_size(Size raw, int factor) { return {raw.width / factor, raw.height / factor}; }

ImageView reduce(const ImageView& source, int factor, std::vector<uint8_t>& pixels) {
  const Size size = reduced_size({source.width, source.height}, factor);
  const int row_values = size.width * source.channels;
  pixels.resize(static_cast<size_t>(row_values) * static_cast<size_t>(size.height));
  parallel_for(size.height, rows_per_block, [&](int begin, int end, int) {
    thread_local std::vector<uint16_t> sums;  // of one row; kept between frames
    sums.resize(static_cast<size_t>(source.width) * static_cast<size_t>(source.channels));
    for (int y = begin; y < end; ++y) {
      add_rows(source, y * factor, factor, sums.data());
      uint8_t* const out = pixels.data() + static_cast<ptrdiff_t>(y) * row_values;
      if (source.channels == 3) {
        mean_of_blocks<3>(sums.data(), size.width, factor, out);
      } else {
        mean_of_blocks<1>(sums.data(), size.width, factor, out);
      }
    }
  });
  return {pixels.data(), size.width, size.height, source.channels, row_values};
}

}  // namespace endosdk
