// Upsampling of the network's disparity to the grid of the view it saw, which guides it.
//
// Bilinear upsampling makes a ramp of every edge. Here a pixel takes the disparity of the cells around it that look like
// it, and of those that the network is surer of (J. Kopf, M. Cohen, D. Lischinski, M. Uyttendaele, "Joint Bilateral
// Upsampling", ACM Transactions on Graphics 26, 2007): an edge of the disparity comes to lie on the edge of the picture.
#pragma once

#include <vector>

#include "images/image.hpp"
#include "kernels/kernels.hpp"
#include "maps/upsampling.hpp"
#include "images/resize.hpp"

namespace endosdk {

// Keeps its memory between frames: nothing is allocated as long as sizes and the number of threads do not grow.
class JointBilateralUpsampling {
 public:
  // Along each axis, in cells, how far away a cell counts for nothing.
  static constexpr int reach = upsampling_reach;

  // Pixels of the view per cell, or 0 where that is no whole number above 1, the same along both axes: then the view
  // cannot guide.
  static int factor(const FloatView& cells, const PlanarView& view);

  // Rows that a thread writes at a time.
  static constexpr int rows_per_block = 8;

  // Begins with a picture: `write_row` may then be called for every row of the view, in any order and on any thread.
  void read(const FloatView& disparity, const FloatView& confidence, const PlanarView& view, const Upsampling& upsampling);
  void write_row(int y);

  // Disparity, in the units it came in, of every pixel of the view, once its rows are written.
  FloatView map() const { return {out_.data(), view_.width, view_.height}; }

 private:
  void prepare(const FloatView& cells, int factor);
  float* plane(int index, int y);
  void read_cells(const FloatView& disparity, const FloatView& confidence, int y);

  PlanarView view_;
  Upsampling upsampling_;
  int factor_ = 0;
  int width_ = 0;   // of the grid of cells
  int height_ = 0;
  int stride_ = 0;  // of a row of cells: the width and what is repeated beyond both its ends
  std::vector<int> start_;      // of each phase of a pixel within its cell, the first of the cells around it
  std::vector<float> share_;    // [phase of the row][phase of the column][taps down][taps along]
  std::vector<float> planes_;   // [joint_bilateral_planes][height][stride]
  std::vector<float> out_;
};

}  // namespace endosdk
