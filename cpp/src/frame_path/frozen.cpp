#include "frame_path/frozen.hpp"

#include <algorithm>
#include <cstring>

namespace endosdk {
namespace {

// Of the pieces of a row, which fill a line of a cache, every sixteenth is read, and in the next row the one beside it.
constexpr size_t piece = 64;
constexpr size_t pieces_apart = 16;
constexpr int patience_alone = 5;  // 0.2 s at 25 frames a second
constexpr int patience_both = 25;

uint64_t mixed(uint64_t print, uint64_t value) {
  print = (print ^ value) * 0x9e3779b97f4a7c15ull;
  return print ^ print >> 29;
}

}  // namespace

uint64_t print_of(const ImageView& image) {
  const size_t bytes = static_cast<size_t>(image.width) * static_cast<size_t>(image.channels);
  // Several at once: each waits for its own former value alone.
  std::array<uint64_t, piece / sizeof(uint64_t)> prints;
  for (size_t k = 0; k < prints.size(); ++k) prints[k] = mixed(bytes + k, static_cast<uint64_t>(image.height));
  for (int y = 0; y < image.height; ++y) {
    const uint8_t* const row = image.row(y);
    for (size_t i = static_cast<size_t>(y) % pieces_apart * piece; i < bytes; i += pieces_apart * piece) {
      std::array<uint64_t, prints.size()> values{};
      if (i + piece <= bytes) {
        std::memcpy(values.data(), row + i, piece);
      } else {
        std::memcpy(values.data(), row + i, bytes - i);
      }
      for (size_t k = 0; k < prints.size(); ++k) prints[k] = mixed(prints[k], values[k]);
    }
  }
  uint64_t print = 0;
  for (const uint64_t each : prints) print = mixed(print, each);
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
