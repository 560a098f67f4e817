#include "maps/field_of_view.hpp"

#include <algorithm>

namespace endosdk {
namespace {

constexpr float darkest = 24.0f;     // grey levels: surroundings are darker
constexpr float evenness = 4.0f;     // grey levels by which they may be brighter than their median
constexpr float least_edge = 8.0f;   // grey levels from them to what lies two cells further in, in the middle of all edges
constexpr double least_border = 0.02;   // of the border that must be dark
constexpr double least_outside = 0.005;  // of the picture; less is no field of view
constexpr double least_inside = 0.1;

enum Mark : uint8_t { unseen = 0, outside = 1, inside_part = 2, largest_part = 3 };

constexpr int steps_x[] = {1, -1, 0, 0};
constexpr int steps_y[] = {0, 0, 1, -1};

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

float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Adds the cells of one mark that are joined to those on the stack; returns how many it took.
template <typename Takes>
int spread(Size size, std::vector<int32_t>& stack, std::vector<uint8_t>& marks, Mark mark, Takes takes) {
  int count = static_cast<int>(stack.size());
  while (!stack.empty()) {
    const int at = stack.back();
    stack.pop_back();
    const int x = at % size.width;
    const int y = at / size.width;
    for (int i = 0; i < 4; ++i) {
      const int u = x + steps_x[i];
      const int v = y + steps_y[i];
      if (u < 0 || v < 0 || u >= size.width || v >= size.height) continue;
      const int next = v * size.width + u;
      if (marks[static_cast<size_t>(next)] != unseen || !takes(next)) continue;
      marks[static_cast<size_t>(next)] = mark;
      stack.push_back(next);
      ++count;
    }
  }
  return count;
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
  fill_from_border(levels, base + evenness);
  if (!ends_at_an_edge(levels, base) || !find_largest_part()) return;
  is_part_ = write() <= 1.0 - least_outside;
}

void FieldOfView::take(const std::vector<uint8_t>& inside, Size cells) {
  make_room(cells);
  std::transform(inside.begin(), inside.end(), mark_.begin(), [](uint8_t cell) { return cell != 0 ? largest_part : outside; });
  find_extents(largest_part);
  is_part_ = write() < 1.0;
}

// All of it, so that the first frame takes what later ones need.
void FieldOfView::make_room(Size cells) {
  size_ = cells;
  is_part_ = false;
  share_ = 1.0;
  const size_t count = static_cast<size_t>(cells.width) * static_cast<size_t>(cells.height);
  mark_.assign(count, unseen);
  inside_.resize(count);
  stack_.clear();
  stack_.reserve(count);
  steps_.clear();
  steps_.reserve(4 * count);
  extents_.resize(static_cast<size_t>(cells.height));
  hull_.reserve(static_cast<size_t>(cells.height));
}

FieldOfView::Extent FieldOfView::extent(int y, int from_edge) const {
  if (!is_part_) return {0, size_.width - 1};
  Extent found = extents_[static_cast<size_t>(y)];
  // A field has no dents, so the rows between reach as far as these.
  for (const int v : {std::max(0, y - from_edge), std::min(y + from_edge, size_.height - 1)}) {
    found.first = std::max(found.first, extents_[static_cast<size_t>(v)].first);
    found.last = std::min(found.last, extents_[static_cast<size_t>(v)].last);
  }
  if (found.first > 0) found.first += from_edge;
  if (found.last < size_.width - 1) found.last -= from_edge;
  return found;
}

void FieldOfView::fill_from_border(const float* levels, float most) {
  for_border(size_, [&](int at) {
    uint8_t& mark = mark_[static_cast<size_t>(at)];
    if (levels[at] > most || mark == outside) return;
    mark = outside;
    stack_.push_back(at);
  });
  spread(size_, stack_, mark_, outside, [&](int at) { return levels[at] <= most; });
}

bool FieldOfView::ends_at_an_edge(const float* levels, float base) {
  steps_.clear();
  for (int y = 0; y < size_.height; ++y) {
    for (int x = 0; x < size_.width; ++x) {
      if (mark_[static_cast<size_t>(y * size_.width + x)] != outside) continue;
      for (int i = 0; i < 4; ++i) {
        const int u = x + 2 * steps_x[i];
        const int v = y + 2 * steps_y[i];
        if (u < 0 || v < 0 || u >= size_.width || v >= size_.height) continue;
        const int next = (y + steps_y[i]) * size_.width + x + steps_x[i];
        const int beyond = v * size_.width + u;
        if (mark_[static_cast<size_t>(next)] == outside || mark_[static_cast<size_t>(beyond)] == outside) continue;
        steps_.push_back(levels[beyond] - base);
      }
    }
  }
  return !steps_.empty() && median(steps_) >= least_edge;
}

// Marks it; text beside the field is in other parts.
bool FieldOfView::find_largest_part() {
  const int count = size_.width * size_.height;
  int most = 0;
  int start = -1;
  for (int at = 0; at < count; ++at) {
    if (mark_[static_cast<size_t>(at)] != unseen) continue;
    mark_[static_cast<size_t>(at)] = inside_part;
    stack_.push_back(at);
    const int cells = spread(size_, stack_, mark_, inside_part, [](int) { return true; });
    if (cells > most) {
      most = cells;
      start = at;
    }
  }
  if (most < least_inside * count) return false;
  for (uint8_t& mark : mark_) mark = mark == inside_part ? unseen : outside;
  mark_[static_cast<size_t>(start)] = largest_part;
  stack_.push_back(start);
  spread(size_, stack_, mark_, largest_part, [](int) { return true; });
  find_extents(largest_part);
  return true;
}

void FieldOfView::find_extents(uint8_t mark) {
  for (int y = 0; y < size_.height; ++y) {
    const uint8_t* const row = mark_.data() + static_cast<ptrdiff_t>(y) * size_.width;
    Extent& extent = extents_[static_cast<size_t>(y)];
    extent = {size_.width, -1};
    for (int x = 0; x < size_.width; ++x) {
      if (row[x] != mark) continue;
      extent.first = std::min(extent.first, x);
      extent.last = x;
    }
  }
}

// Takes away the dents of one side, -1: left, 1: right: rows between two others reach at least as far as the line that
// joins those.
void FieldOfView::straighten(int side) {
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

double FieldOfView::write() {
  straighten(-1);
  straighten(1);
  int64_t count = 0;
  for (int y = 0; y < size_.height; ++y) {
    const Extent& extent = extents_[static_cast<size_t>(y)];
    float* const row = inside_.data() + static_cast<ptrdiff_t>(y) * size_.width;
    for (int x = 0; x < size_.width; ++x) row[x] = x >= extent.first && x <= extent.last ? 1.0f : 0.0f;
    count += std::max(0, extent.last - extent.first + 1);
  }
  share_ = static_cast<double>(std::max<int64_t>(1, count)) / static_cast<double>(inside_.size());
  return share_;
}

}  // namespace endosdk
