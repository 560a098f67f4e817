#include "maps/overlays.hpp"

#include <algorithm>

namespace endosdk {
namespace {

// If more blocks are equal, the frames show one view twice. That is a cause of its own.
constexpr double most_blocks = 0.6;

}  // namespace

template <typename Visit>
void Overlays::for_around(int32_t block, Visit visit) const {
  const int32_t x = block % blocks_.width;
  const int32_t y = block / blocks_.width;
  for (int32_t v = std::max(0, y - 1); v <= std::min(y + 1, blocks_.height - 1); ++v) {
    for (int32_t u = std::max(0, x - 1); u <= std::min(x + 1, blocks_.width - 1); ++u) visit(v * blocks_.width + u);
  }
}

void Overlays::find(const EqualBlocks& raw, const BlocksOfCells& blocks, const MatchedViews& views) {
  any_ = false;
  blocks_ = raw.size();
  cells_ = views.size();
  const std::vector<uint8_t>& marks = raw.marks();
  // Room for every later frame of this size.
  for (std::vector<uint8_t>* room : {&surroundings_, &found_}) room->resize(marks.size());
  open_.reserve(marks.size());
  for (std::vector<uint8_t>& room : covered_) room.resize(count_of(cells_));
  if (!raw.any()) return;
  mark_surroundings(blocks, views);
  keep_neighbours(marks);
  if (open_.empty()) return;
  grow(marks);
  widen();
  cover_cells(blocks, views);
}

// The surroundings of a round picture are equal in both frames, and often have text. They are outside the view anyway.
void Overlays::mark_surroundings(const BlocksOfCells& blocks, const MatchedViews& views) {
  std::fill(surroundings_.begin(), surroundings_.end(), uint8_t{0});
  for (int view = 0; view < 2; ++view) {
    if (!views.field(view).is_part()) continue;
    const int32_t* block = blocks.of[view].data();
    for (int y = 0; y < cells_.height; ++y) {
      for (int x = 0; x < cells_.width; ++x, ++block) {
        if (*block >= 0 && !views.sees(view, x, y)) surroundings_[static_cast<size_t>(*block)] = 1;
      }
    }
  }
}

// Text is longer than a block. A single block may be equal by chance.
void Overlays::keep_neighbours(const std::vector<uint8_t>& marks) {
  std::fill(found_.begin(), found_.end(), uint8_t{0});
  open_.clear();
  const auto tells = [&](int32_t block) {
    if (marks[static_cast<size_t>(block)] != EqualBlocks::telling) return false;
    bool inside = true;
    for_around(block, [&](int32_t near) { inside = inside && surroundings_[static_cast<size_t>(near)] == 0; });
    return inside;
  };
  for (int32_t block = 0; block < static_cast<int32_t>(marks.size()); ++block) {
    if (!tells(block)) continue;
    int together = 0;
    for_around(block, [&](int32_t near) { together += tells(near) ? 1 : 0; });
    if (together < 2) continue;
    found_[static_cast<size_t>(block)] = 1;
    open_.push_back(block);
  }
}

// A menu is flat between its lines of text.
void Overlays::grow(const std::vector<uint8_t>& marks) {
  while (!open_.empty()) {
    const int32_t block = open_.back();
    open_.pop_back();
    for_around(block, [&](int32_t near) {
      const auto at = static_cast<size_t>(near);
      if (found_[at] != 0 || surroundings_[at] != 0 || marks[at] == EqualBlocks::differs) return;
      found_[at] = 1;
      open_.push_back(near);
    });
  }
}

// Blocks at the edge of an overlay show both, and the network's disparity changes slowly there.
void Overlays::widen() {
  constexpr uint8_t edge = 2;
  for (int32_t block = 0; block < static_cast<int32_t>(found_.size()); ++block) {
    if (found_[static_cast<size_t>(block)] != 1) continue;
    for_around(block, [&](int32_t near) {
      uint8_t& mark = found_[static_cast<size_t>(near)];
      if (mark == 0) mark = edge;
    });
  }
}

void Overlays::cover_cells(const BlocksOfCells& blocks, const MatchedViews& views) {
  const auto found = std::count_if(found_.begin(), found_.end(), [](uint8_t mark) { return mark != 0; });
  if (static_cast<double>(found) > most_blocks * static_cast<double>(found_.size())) return;
  any_ = true;
  for (int view = 0; view < 2; ++view) {
    std::transform(blocks.of[view].begin(), blocks.of[view].end(), covered_[view].begin(),
                   [&](int32_t block) -> uint8_t { return block >= 0 && found_[static_cast<size_t>(block)] != 0 ? 1 : 0; });
  }
  int64_t count = 0;
  for (int y = 0; y < cells_.height; ++y) {
    const uint8_t* const covered = row(0, y);
    for (int x = 0; x < cells_.width; ++x) count += covered[x] != 0 && views.sees(0, x, y) ? 1 : 0;
  }
  share_ = static_cast<double>(count) / static_cast<double>(covered_[0].size());
}

}  // namespace endosdk
