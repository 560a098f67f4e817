#include "images/equal_blocks.hpp"

#include <algorithm>
#include <cstdlib>

#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int columns = 60;
constexpr int least_side = 4;
constexpr int rows_of_block = 4;  // that are looked at
constexpr int steps_of_block = 8;  // a step along a row is over this part of a block
constexpr int steep = 60;              // grey levels, from which a step is one of text or of an edge
constexpr double least_steep = 0.06;   // share of the steps of a block
constexpr double least_rarer = 0.2;    // share of the steep ones that go up, and that go down
constexpr double least_repeated = 0.8;  // share of the steep ones that the other frame has as well
constexpr int tolerance = 4;  // such a step differs by at most this part
constexpr double same = 2.0;      // mean squared difference of equal blocks without texture
constexpr double least_texture = 200.0;  // mean squared step
constexpr double like = 0.015;  // mean squared difference of equal blocks, as a share of their texture

// The same rows of a block in both frames, and what of each row is looked at.
struct Block {
  const uint8_t* left[rows_of_block];
  const uint8_t* right[rows_of_block];
  int side;
  int channels;

  int bytes() const { return side * channels; }
  int step() const { return std::max(1, side / steps_of_block) * channels; }
};

Block block_at(const ImageView& left, const ImageView& right, int side, int x, int y) {
  Block block{{}, {}, side, left.channels};
  for (int i = 0; i < rows_of_block; ++i) {
    const int row = y * side + (2 * i + 1) * side / (2 * rows_of_block);
    block.left[i] = left.row(row) + static_cast<ptrdiff_t>(x) * block.bytes();
    block.right[i] = right.row(row) + static_cast<ptrdiff_t>(x) * block.bytes();
  }
  return block;
}

// Steep steps of a row: up, and all. The inner counts are one byte, over so few steps that they cannot overflow, so that the
// compiler uses whole vectors of bytes.
struct Steps {
  int up = 0;
  int all = 0;
};

Steps steep_steps(const uint8_t* row, int step, int count) {
  constexpr int group = 240;
  Steps total;
  for (int first = 0; first < count; first += group) {
    const int end = std::min(first + group, count);
    uint8_t up = 0;
    uint8_t all = 0;
    for (int i = first; i < end; ++i) {
      const uint8_t a = row[i];
      const uint8_t b = row[i + step];
      const auto size = static_cast<uint8_t>(a > b ? a - b : b - a);
      const bool is_steep = size >= steep;
      all = static_cast<uint8_t>(all + (is_steep ? 1 : 0));
      up = static_cast<uint8_t>(up + (is_steep && b > a ? 1 : 0));
    }
    total.up += up;
    total.all += all;
  }
  return total;
}

// Steep steps of the left row that the right row repeats.
int repeated_steps(const uint8_t* left, const uint8_t* right, int step, int count) {
  int found = 0;
  for (int i = 0; i < count; ++i) {
    const int here = left[i + step] - left[i];
    const int there = right[i + step] - right[i];
    found += std::abs(here) >= steep && tolerance * std::abs(here - there) <= std::abs(here) ? 1 : 0;
  }
  return found;
}

// Whether the right frame repeats the steps of the left one. In a scene, they lie elsewhere. A stroke of a letter has a step up
// and one down. The rim of a round picture, which may lie at the same place in both frames, has only one of them.
bool tells(const Block& block) {
  const int count = block.bytes() - block.step();
  Steps steps;
  for (const uint8_t* const row : block.left) {
    const Steps here = steep_steps(row, block.step(), count);
    steps.up += here.up;
    steps.all += here.all;
  }
  if (steps.all < least_steep * (rows_of_block * count)) return false;
  if (std::min(steps.up, steps.all - steps.up) < least_rarer * steps.all) return false;
  int repeated = 0;
  for (int i = 0; i < rows_of_block; ++i) repeated += repeated_steps(block.left[i], block.right[i], block.step(), count);
  return repeated >= least_repeated * steps.all;
}

// Sum of the squared differences of two rows of bytes.
int sum_of_squares(const uint8_t* a, const uint8_t* b, int count) {
  int sum = 0;
  for (int i = 0; i < count; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

// Mean squared step along the rows of a block.
double texture_of(const uint8_t* const (&rows)[rows_of_block], int step, int count) {
  int64_t sum = 0;
  for (const uint8_t* const row : rows) sum += sum_of_squares(row, row + step, count);
  return static_cast<double>(sum) / (rows_of_block * count);
}

bool equals(const Block& block) {
  int64_t squares = 0;
  for (int i = 0; i < rows_of_block; ++i) squares += sum_of_squares(block.left[i], block.right[i], block.bytes());
  const double difference = static_cast<double>(squares) / (rows_of_block * block.bytes());
  if (difference <= same) return true;
  const int count = block.bytes() - block.step();
  const double texture = std::min(texture_of(block.left, block.step(), count), texture_of(block.right, block.step(), count));
  return texture >= least_texture && difference <= like * texture;
}

}  // namespace

int EqualBlocks::side_of(Size frame) { return std::max(least_side, (frame.width + columns / 2) / columns); }

Size EqualBlocks::blocks_of(Size frame) {
  const int side = side_of(frame);
  return {frame.width / side, frame.height / side};
}

void EqualBlocks::compare(const ImageView& left, const ImageView& right) {
  const int side = side_of(left.size());
  size_ = blocks_of(left.size());
  marks_.resize(count_of(size_));
  const auto mark_blocks = [&](auto mark) {
    parallel_for(size_.height, 1, [&](int begin, int end, int) {
      for (int y = begin; y < end; ++y) {
        uint8_t* const marks = marks_.data() + static_cast<ptrdiff_t>(y) * size_.width;
        for (int x = 0; x < size_.width; ++x) mark(block_at(left, right, side, x, y), marks[x]);
      }
    });
  };
  mark_blocks([](const Block& block, uint8_t& mark) { mark = tells(block) ? telling : differs; });
  any_ = std::find(marks_.begin(), marks_.end(), telling) != marks_.end();
  // Most frames have none, and need no other marks.
  if (!any_) return;
  mark_blocks([](const Block& block, uint8_t& mark) {
    if (mark == differs && equals(block)) mark = equal;
  });
}

}  // namespace endosdk
