// The field of view: the part of a picture that the optics fill. It is found in the picture itself, or stated by the rig.
//
// The surroundings of the field are evenly dark, touch the border of the picture and end at an edge. Dark tissue has no such
// edge, because it darkens slowly; then no field is found. A field of view has no dents, so tissue as dark as the surroundings
// is added back to it. The surroundings are dark all over, but for text; behind a dark instrument the scene goes on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "images/resize.hpp"
#include "images/size.hpp"

namespace endosdk {

// Keeps its memory between frames: nothing is allocated as long as sizes do not grow.
class FieldOfView {
 public:
  // The first and the last cell of a row; no cell where last < first.
  struct Extent {
    int first;
    int last;
  };

  // Finds the field in a picture. `levels` are grey levels of cells, row by row.
  void find(const float* levels, Size cells);

  // Takes the field from a mask of cells, row by row. A cell that is not 0 is inside. The mask has no dents.
  void take(const std::vector<uint8_t>& inside, Size cells);

  // Whether the field is smaller than the picture.
  bool is_part() const { return is_part_; }

  // The cells of row y that lie in the field, at least `from_edge` cells from its edge, both down and along. The border of the
  // picture is no edge.
  Extent extent(int y, int from_edge) const;

  bool inside(int x, int y) const { return inside_[static_cast<size_t>(y) * static_cast<size_t>(size_.width) + static_cast<size_t>(x)] > 0.5f; }

  // 1 for cells inside, 0 for others.
  FloatView map() const { return {inside_.data(), size_.width, size_.height}; }

  // Share of all cells that lie inside; never 0.
  double share() const { return share_; }

 private:
  // Neighbouring cells of a row that have the same mark.
  struct Run {
    int y;
    int first;
    int last;
    int32_t part;  // an earlier run of the same part, or this run
    int32_t cells;  // cells of the whole part, if this is its first run
  };

  void make_room(Size cells);
  void find_parts(uint8_t mark);
  int32_t part_of(int32_t run);
  void join(int32_t a, int32_t b);
  void add(const Run& run);
  void keep_those_at_the_border();
  bool ends_at_an_edge(const float* levels, float base);
  bool find_largest_part();
  void remove_dents();
  void remove_dents(int side);
  void fill_map();
  double bright_outside() const;

  Size size_;
  bool is_part_ = false;
  double share_ = 1.0;
  std::vector<uint8_t> mark_;  // a `Mark` for each cell
  std::vector<Run> runs_;
  std::vector<float> steps_;
  std::vector<Extent> extents_;
  std::vector<int32_t> hull_;
  std::vector<float> inside_;
};

}  // namespace endosdk
