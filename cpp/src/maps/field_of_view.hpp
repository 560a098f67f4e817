// The part of a view that the optics fill, found in the picture itself or stated by the rig.
//
// Around a circle, an octagon or bars lies an even dark, joined to the border, that ends at an edge. Dark tissue fades: no
// edge, no field. A field of view has no dents, so tissue as dark as its surroundings is taken back into it.
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
  // Where a row of cells begins and ends; none where last < first.
  struct Extent {
    int first;
    int last;
  };

  // `levels` are grey levels of cells, row by row.
  void find(const float* levels, Size cells);

  // Takes it from a mask of cells, row by row, without dents; not 0: inside.
  void take(const std::vector<uint8_t>& inside, Size cells);

  // Whether it leaves anything out.
  bool is_part() const { return is_part_; }

  // The cells of a row that lie in the field, at least so many, down or along, from its edge. The border of the picture is
  // no edge.
  Extent extent(int y, int from_edge) const;

  bool inside(int x, int y) const { return inside_[static_cast<size_t>(y) * static_cast<size_t>(size_.width) + static_cast<size_t>(x)] > 0.5f; }

  // 1 for cells inside and 0 for others.
  FloatView map() const { return {inside_.data(), size_.width, size_.height}; }

  // Of all cells; never 0.
  double share() const { return share_; }

 private:
  // Neighbouring cells of a row that are taken for the same.
  struct Run {
    int y;
    int first;
    int last;
    int32_t part;  // a run before it, or itself, of the same part
    int32_t cells;  // of the whole part, where it is its first run
  };

  void make_room(Size cells);
  void find_parts(uint8_t mark);
  int32_t part_of(int32_t run);
  void join(int32_t a, int32_t b);
  void add(const Run& run);
  void keep_those_at_the_border();
  bool ends_at_an_edge(const float* levels, float base);
  bool find_largest_part();
  void straighten(int side);
  double write();

  Size size_;
  bool is_part_ = false;
  double share_ = 1.0;
  std::vector<uint8_t> mark_;  // what a cell is taken for
  std::vector<Run> runs_;
  std::vector<float> steps_;
  std::vector<Extent> extents_;
  std::vector<int32_t> hull_;
  std::vector<float> inside_;
};

}  // namespace endosdk
