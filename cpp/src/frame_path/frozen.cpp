#include "frame_path/frozen.hpp"

#include <algorithm>
#include <cstring>

namespace endosdk {
namespace {

constexpr int rows_apart = 8;
constexpr int patience_alone = 5;  // 0.2 s at 25 frames a second
constexpr int patience_both = 25;

uint64_t mixed(uint64_t print, uint64_t value) {
  print = (print ^ value) * 0x9e3779b97f4a7c15ull;
  return print ^ print >> 29;
}

}  // namespace

uint64_t print_of(const ImageView& image) {
  const size_t bytes = static_cast<size_t>(image.width) * static_cast<size_t>(image.channels);
  uint64_t print = mixed(bytes, static_cast<uint64_t>(image.height));
  for (int y = 0; y < image.height; y += rows_apart) {
    const uint8_t* const row = image.row(y);
    for (size_t i = 0; i < bytes; i += sizeof(uint64_t)) {
      uint64_t value = 0;
      std::memcpy(&value, row + i, std::min(sizeof value, bytes - i));
      print = mixed(print, value);
    }
  }
  return print;
}

int Frozen::repeats(const Prints& prints) {
  for (size_t i = 0; i < prints.size(); ++i) repeats_[i] = any_ && prints[i] == latest_[i] ? repeats_[i] + 1 : 0;
  latest_ = prints;
  any_ = true;
  const int both = std::min(repeats_[0], repeats_[1]);
  const int alone = std::max(repeats_[0], repeats_[1]) - both;
  return std::max(alone >= patience_alone ? alone : 0, both >= patience_both ? both : 0);
}

}  // namespace endosdk
