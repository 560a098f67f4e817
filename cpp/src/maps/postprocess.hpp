// From the network's small maps to full-size disparity, confidence, reasons, depth and expected error, in one pass.
#pragma once

#include <cstdint>

#include "maps/photometric_consistency.hpp"
#include "maps/field_rows.hpp"
#include "maps/glare_rows.hpp"
#include "maps/joint_bilateral.hpp"
#include "maps/maps.hpp"
#include "maps/row_disparity.hpp"
#include "maps/view_measures.hpp"
#include "images/image.hpp"
#include "images/resize.hpp"

namespace endosdk {

// Rectified geometry and the range in which it was calibrated. Without it (focal_px 0) there is no depth.
struct DepthGeometry {
  double focal_px = 0.0;
  double baseline_mm = 0.0;
  double doffs = 0.0;
  double min_depth_mm = 0.0;
  double max_depth_mm = 0.0;  // may be infinite
};

// Answers this close to an end of the network's range, in network pixels, count as out of range. Surfaces beyond the
// largest candidate disparity come out at it or a little short of it, with high confidence. Near 0, an error of the margin
// is as large as the disparity itself: the depth could as well be infinite.
constexpr double range_margin = 0.5;

struct PostprocessInput {
  Size size;             // of the maps that come out
  FloatView disparity;   // network pixels
  FloatView confidence;  // probability that the network's error is at most one of its pixels
  Scale scale;
  float gain = 1.0f;  // network pixels to frame pixels
  double reach = 1.0;  // network pixels; the confidence that comes out is of errors up to so many
  float min_confidence = 0.0f;
  double max_candidate_disparity = 0.0;  // largest disparity the network has a plane for, network pixels; 0: not known
  PlanarView left;  // as the network saw it, for saturation and to guide the upsampling; no data: neither
  PlanarView right;  // of the same size; no data: photometric consistency is not tested
  Scale view_scale;  // pixels of those views per output pixel; each output pixel takes the nearest
  MatchedViews::Fields fields{};  // of view of left and right, where they are known
  double right_shift = 0.0;  // frame pixels by which the right view was moved to the left before the network saw it
  const uint8_t* valid_left = nullptr;   // masks of the output's size; null: all valid
  const uint8_t* valid_right = nullptr;
  Upsampling upsampling;
  DepthGeometry geometry;
  PosePattern pattern;  // of the output's pixels; without a focal length nothing is measured across the rows
};

// Tables and scratch rows, kept between frames so that a frame allocates nothing.
struct PostprocessScratch {
  RowResizer disparity;
  RowResizer confidence;
  RowResizer own;
  std::vector<float> own_row;  // per worker
  JointBilateralUpsampling upsampling;
  GlareRows glare;
  FieldRows fields;
  MatchedViews views;
  PhotometricConsistency consistency;
  RowDisparity rows;
  ViewMeasures measures;
  double trust_ms = 0.0;  // what comparing the views of the latest frame took
};

// Where the left view has a whole number of pixels, two or more, per cell of the disparity, the disparity comes to the
// view's grid by joint bilateral upsampling, and from there to the output, like the confidence from its own grid, by bilinear resizing.
// Returns the number of pixels with no reason against them. Disparities that come out are those of the views before the
// right one was moved. Depth (mm) is focal * baseline / (disparity + doffs); sigma
// (mm) is depth^2 / (focal * baseline) times the scale of a Laplace law whose probability of an error up to
// one network pixel is the network's own confidence, with what the pictures leave of it. To it comes what a rig that moved
// does to the disparity. Both are NaN where a pixel has a reason; both need a geometry and may be null, depth only with sigma.
// The 16-bit maps are written by write_u16().
int postprocess(const PostprocessInput& input, const MapsOut& maps, PostprocessScratch& scratch);

}  // namespace endosdk
