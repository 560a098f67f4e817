// Joint bilateral upsampling of the network's disparity to the grid of the view that the network saw. The view guides it.
//
// Bilinear upsampling turns every edge into a ramp. Here a pixel takes the disparity of the cells around it that look like it
// and of which the network is more certain (J. Kopf, M. Cohen, D. Lischinski, M. Uyttendaele, "Joint Bilateral Upsampling", ACM
// Transactions on Graphics 26, 2007). So an edge of the disparity lies on the edge of the picture.
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
  // Distance along each axis, in cells, from which on a cell does not count.
  static constexpr int reach = upsampling_reach;

  // Pixels of the view per cell. Returns 0 if this is not a whole number above 1, equal along both axes. Then the view cannot
  // guide the upsampling.
  static int factor(const FloatView& cells, const PlanarView& view);

  // Rows that a thread writes at a time.
  static constexpr int rows_per_block = 8;

  // Reads one frame. Then `write_row` may be called for every row of the view, in any order and on any thread.
  void read(const FloatView& disparity, const FloatView& confidence, const PlanarView& view, const Upsampling& upsampling);
  void write_row(int y);

  // Disparity of every pixel of the view, in the unit of the input, once all rows are written.
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
  int stride_ = 0;  // values per row of cells: the width, and the cells repeated beyond both ends
  std::vector<int> start_;      // first of the cells around a pixel, for each phase of the pixel within its cell
  std::vector<float> share_;    // [phase of the row][phase of the column][taps down][taps along]
  std::vector<float> planes_;   // [joint_bilateral_planes][height][stride]
  std::vector<float> out_;
};

}  // namespace endosdk
