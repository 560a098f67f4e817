#include "maps/field_of_view.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "geometry/median.hpp"

namespace endosdk {
namespace {

constexpr float darkest = 24.0f;     // grey level: surroundings are darker
constexpr float evenness = 4.0f;     // grey levels by which a cell of the surroundings may exceed their median
constexpr float least_edge = 8.0f;   // grey levels: median step from the surroundings to the cells two further in
constexpr double least_border = 0.02;   // share of the border that must be dark
constexpr double least_outside = 0.005;  // share of the picture outside; with less there is no field of view
constexpr double least_inside = 0.1;
constexpr double most_bright = 0.08;  // share of the outside that is not dark, such as text beside the field

enum Mark : uint8_t { inside_mark = 0, outside_mark = 1 };

template <typename Visit>
void for_border(Size size, Visit visit) {
  for (int x = 0; x < size.width; ++x) {
    visit(x);
    visit((size.height - 1) * size.width + x);
  }
  for (int y = 1; y + 1 < size.height; ++y) {
    visit(y * size.width);
    visit(y * size.width + size.width - 1);
  }
}

const uint8_t* first_of(const uint8_t* begin, const uint8_t* end, uint8_t mark) {
  const void* const found = std::memchr(begin, mark, static_cast<size_t>(end - begin));
  return found != nullptr ? static_cast<const uint8_t*>(found) : end;
}

}  // namespace

void FieldOfView::find(const float* levels, Size cells) {
  make_room(cells);
  if (inside_.empty()) return;
  int border = 0;
  for_border(cells, [&](int at) {
    ++border;
    if (levels[at] < darkest) steps_.push_back(levels[at]);
  });
  if (steps_.empty() || static_cast<double>(steps_.size()) < least_border * border) return;
  const float base = median(steps_);
  const float most = base + evenness;
  for (size_t i = 0; i < mark_.size(); ++i) mark_[i] = levels[i] <= most ? outside_mark : inside_mark;
  find_parts(outside_mark);
  keep_those_at_the_border();
  if (!ends_at_an_edge(levels, base) || !find_largest_part()) return;
  remove_dents();
  fill_map();
  is_part_ = share_ <= 1.0 - least_outside && bright_outside() <= most_bright;
  if (!is_part_) share_ = 1.0;
}

void FieldOfView::take(const std::vector<uint8_t>& inside, Size cells) {
  make_room(cells);
  std::transform(inside.begin(), inside.end(), mark_.begin(), [](uint8_t cell) { return cell != 0 ? inside_mark : outside_mark; });
  find_parts(inside_mark);
  for (const Run& run : runs_) add(run);
  remove_dents();
  fill_map();
  is_part_ = share_ < 1.0;
}

// Allocates all memory at once, so that frames after the first allocate nothing.
void FieldOfView::make_room(Size cells) {
  size_ = cells;
  is_part_ = false;
  share_ = 1.0;
  const size_t count = count_of(cells);
  mark_.resize(count);
  inside_.resize(count);
  runs_.reserve(count / 2 + static_cast<size_t>(cells.height));
  steps_.clear();
  steps_.reserve(4 * count);
  extents_.assign(static_cast<size_t>(cells.height), {cells.width, -1});
  hull_.reserve(static_cast<size_t>(cells.height));
}

FieldOfView::Extent FieldOfView::extent(int y, int from_edge) const {
  if (!is_part_) return {0, size_.width - 1};
  Extent found = extents_[static_cast<size_t>(y)];
  // A field has no dents, so the rows in between reach at least as far as these two.
  for (const int v : {std::max(0, y - from_edge), std::min(y + from_edge, size_.height - 1)}) {
    found.first = std::max(found.first, extents_[static_cast<size_t>(v)].first);
    found.last = std::min(found.last, extents_[static_cast<size_t>(v)].last);
  }
  if (found.first > 0) found.first += from_edge;
  if (found.last < size_.width - 1) found.last -= from_edge;
  return found;
}

// Finds the runs of cells with this mark. Runs with cells that share a side belong to one part.
void FieldOfView::find_parts(uint8_t mark) {
  runs_.clear();
  size_t above = 0;
  for (int y = 0; y < size_.height; ++y) {
    const uint8_t* const row = mark_.data() + static_cast<ptrdiff_t>(y) * size_.width;
    const uint8_t* const end = row + size_.width;
    const size_t begin = runs_.size();
    for (const uint8_t* at = first_of(row, end, mark); at < end; at = first_of(at, end, mark)) {
      const int first = static_cast<int>(at - row);
      at = first_of(at, end, static_cast<uint8_t>(1 - mark));
      const int last = static_cast<int>(at - row) - 1;
      const auto here = static_cast<int32_t>(runs_.size());
      runs_.push_back({y, first, last, here, last - first + 1});
      while (above < begin && runs_[above].last < first) ++above;
      for (size_t i = above; i < begin && runs_[i].first <= last; ++i) join(static_cast<int32_t>(i), here);
    }
    above = begin;
  }
}

// The first run of its part.
int32_t FieldOfView::part_of(int32_t run) {
  while (true) {
    int32_t& part = runs_[static_cast<size_t>(run)].part;
    if (part == run) return run;
    part = runs_[static_cast<size_t>(part)].part;
    run = part;
  }
}

void FieldOfView::join(int32_t a, int32_t b) {
  a = part_of(a);
  b = part_of(b);
  if (a == b) return;
  if (a > b) std::swap(a, b);
  runs_[static_cast<size_t>(b)].part = a;
  runs_[static_cast<size_t>(a)].cells += runs_[static_cast<size_t>(b)].cells;
}

// Only the dark parts that reach the border of the picture stay outside. The others are marked as inside.
void FieldOfView::keep_those_at_the_border() {
  const auto count = static_cast<int32_t>(runs_.size());
  for (int32_t i = 0; i < count; ++i) {
    const Run& run = runs_[static_cast<size_t>(i)];
    const bool at_border = run.y == 0 || run.y == size_.height - 1 || run.first == 0 || run.last == size_.width - 1;
    if (at_border) runs_[static_cast<size_t>(part_of(i))].cells = 0;
  }
  for (int32_t i = 0; i < count; ++i) {
    if (runs_[static_cast<size_t>(part_of(i))].cells == 0) continue;
    const Run& run = runs_[static_cast<size_t>(i)];
    std::fill_n(mark_.begin() + static_cast<ptrdiff_t>(run.y) * size_.width + run.first, run.last - run.first + 1, inside_mark);
  }
}

// Tests the median step, over all edges, from the level of the outside (`base`) to the cells two further in.
bool FieldOfView::ends_at_an_edge(const float* levels, float base) {
  steps_.clear();
  const auto look = [&](ptrdiff_t at, ptrdiff_t step) {
    if (mark_[static_cast<size_t>(at + step)] == inside_mark && mark_[static_cast<size_t>(at + 2 * step)] == inside_mark) {
      steps_.push_back(levels[at + 2 * step] - base);
    }
  };
  for (const Run& run : runs_) {
    const ptrdiff_t row = static_cast<ptrdiff_t>(run.y) * size_.width;
    if (mark_[static_cast<size_t>(row + run.first)] != outside_mark) continue;
    if (run.first >= 2) look(row + run.first, -1);
    if (run.last + 2 < size_.width) look(row + run.last, 1);
    for (const int direction : {-1, 1}) {
      if (run.y + 2 * direction < 0 || run.y + 2 * direction >= size_.height) continue;
      for (int x = run.first; x <= run.last; ++x) look(row + x, static_cast<ptrdiff_t>(direction) * size_.width);
    }
  }
  return !steps_.empty() && median(steps_) >= least_edge;
}

// Share of the cells outside the field that are not dark. Where a dark instrument or organ reaches the border, the scene goes on
// behind it.
double FieldOfView::bright_outside() const {
  int64_t all = 0;
  int64_t bright = 0;
  for (size_t i = 0; i < mark_.size(); ++i) {
    if (inside_[i] > 0.5f) continue;
    ++all;
    bright += mark_[i] == inside_mark ? 1 : 0;
  }
  return all > 0 ? static_cast<double>(bright) / static_cast<double>(all) : 0.0;
}

// Takes the extents of the largest part alone: text beside the field forms other parts. False where the part is too small.
bool FieldOfView::find_largest_part() {
  find_parts(inside_mark);
  int32_t largest = -1;
  int32_t most = 0;
  const auto count = static_cast<int32_t>(runs_.size());
  for (int32_t i = 0; i < count; ++i) {
    if (part_of(i) != i || runs_[static_cast<size_t>(i)].cells <= most) continue;
    most = runs_[static_cast<size_t>(i)].cells;
    largest = i;
  }
  if (most < least_inside * static_cast<double>(mark_.size())) return false;
  for (int32_t i = 0; i < count; ++i) {
    if (part_of(i) == largest) add(runs_[static_cast<size_t>(i)]);
  }
  return true;
}

void FieldOfView::add(const Run& run) {
  Extent& extent = extents_[static_cast<size_t>(run.y)];
  extent.first = std::min(extent.first, run.first);
  extent.last = std::max(extent.last, run.last);
}

void FieldOfView::remove_dents() {
  remove_dents(-1);
  remove_dents(1);
}

// Removes the dents of one side (-1: left, 1: right): a row between two others reaches at least as far as the line that joins
// them.
void FieldOfView::remove_dents(int side) {
  const auto reach = [&](int y) {
    const Extent& extent = extents_[static_cast<size_t>(y)];
    return side > 0 ? extent.last : -extent.first;
  };
  hull_.clear();
  for (int y = 0; y < size_.height; ++y) {
    if (extents_[static_cast<size_t>(y)].last < extents_[static_cast<size_t>(y)].first) continue;
    while (hull_.size() >= 2) {
      const int a = hull_[hull_.size() - 2];
      const int b = hull_.back();
      const int64_t below = int64_t{reach(b) - reach(a)} * (y - a) - int64_t{reach(y) - reach(a)} * (b - a);
      if (below > 0) break;
      hull_.pop_back();
    }
    hull_.push_back(y);
  }
  for (size_t i = 0; i + 1 < hull_.size(); ++i) {
    const int a = hull_[i];
    const int b = hull_[i + 1];
    const int from = reach(a);
    const int to = reach(b);
    for (int y = a + 1; y < b; ++y) {
      const int64_t rise = int64_t{to - from} * (y - a);
      const int64_t step = rise >= 0 ? rise / (b - a) : -((-rise + (b - a) - 1) / (b - a));  // rounded down
      const int at = from + static_cast<int>(step);
      Extent& extent = extents_[static_cast<size_t>(y)];
      if (side > 0) extent.last = at;
      else extent.first = -at;
    }
  }
}

// Writes the map and the share from the extents.
void FieldOfView::fill_map() {
  int64_t count = 0;
  for (int y = 0; y < size_.height; ++y) {
    const Extent& extent = extents_[static_cast<size_t>(y)];
    float* const row = inside_.data() + static_cast<ptrdiff_t>(y) * size_.width;
    for (int x = 0; x < size_.width; ++x) row[x] = x >= extent.first && x <= extent.last ? 1.0f : 0.0f;
    count += std::max(0, extent.last - extent.first + 1);
  }
  share_ = static_cast<double>(std::max<int64_t>(1, count)) / static_cast<double>(inside_.size());
}

}  // namespace endosdk
