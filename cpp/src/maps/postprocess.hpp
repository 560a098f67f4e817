// Post-processing: turns the network's small maps into full-size disparity, confidence, reasons, depth and expected error, in
// one pass.
#pragma once

#include <cstdint>

#include "maps/photometric_consistency.hpp"
#include "maps/field_rows.hpp"
#include "maps/glare_rows.hpp"
#include "maps/joint_bilateral.hpp"
#include "maps/maps.hpp"
#include "maps/overlays.hpp"
#include "maps/patch_search.hpp"
#include "maps/row_disparity.hpp"
#include "maps/view_measures.hpp"
#include "images/image.hpp"
#include "images/resize.hpp"

namespace endosdk {

// Rectified geometry, and the range of depths that counts as an answer. Without it (focal_px 0) there is no depth.
struct DepthGeometry {
  double focal_px = 0.0;
  double baseline_mm = 0.0;
  double doffs = 0.0;
  double min_depth_mm = 0.0;
  double max_depth_mm = 0.0;  // may be infinite
};

// Disparities this close to an end of the network's range, in network pixels, count as out of range. For surfaces beyond the
// maximum candidate disparity, networks give this maximum or a little less, with high confidence. Near 0, an error of this
// margin is as large as the disparity itself: the depth could as well be infinite.
constexpr double range_margin = 0.5;

struct PostprocessInput {
  Size size;             // size of the output maps
  FloatView disparity;   // network pixels
  FloatView confidence;  // probability that the network's error is at most one of its pixels
  Scale scale;
  float gain = 1.0f;  // network pixels to frame pixels
  double reach = 1.0;  // network pixels; the output confidence is the probability of an error up to this
  float min_confidence = 0.0f;
  double max_candidate_disparity = 0.0;  // largest disparity the network has a plane for, network pixels; 0: not known
  PlanarView left;  // as the network saw it, for saturation and to guide the upsampling; without data: neither
  PlanarView right;  // has the size of `left`; without data, photometric consistency is not tested
  Scale view_scale;  // pixels of these views per output pixel; each output pixel takes the nearest
  MatchedViews::Fields fields{};  // known fields of view
  const EqualBlocks* equal = nullptr;  // of the raw frames; null: overlays are not looked for
  const BlocksOfCells* blocks = nullptr;
  double right_shift = 0.0;  // frame pixels by which the right view was moved to the left before the network saw it
  const uint8_t* valid_left = nullptr;   // masks of the output's size; null: all valid
  const uint8_t* valid_right = nullptr;
  Upsampling upsampling;
  DepthGeometry geometry;
  PosePattern pattern;  // in output pixels; without a focal length the vertical disparity is not measured
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
  Overlays overlays;
  PhotometricConsistency consistency;
  RowDisparity rows;
  ViewMeasures measures;
  PatchSearch search;
  double rivals = 0.0;  // see share_of_rivals()
  double trust_ms = 0.0;  // by which the comparison of the views made the latest frame longer
};

// Writes the maps. Returns the number of pixels without a reason.
//
// If the left view has a whole number of pixels, two or more, per cell of the disparity, joint bilateral upsampling brings the
// disparity to the grid of the view. Bilinear resizing then brings it to the output, and the confidence from its own grid.
// Output disparities are those of the views before the right one was moved.
//
// Depth (mm) is focal * baseline / (disparity + doffs). Sigma (mm) is depth^2 / (focal * baseline) times the scale of a Laplace
// law. In this law, the probability of an error up to one network pixel is the part of the network's own confidence that the
// pictures leave. Sigma also includes the error from a rig that has moved. Depth and sigma are NaN where a pixel has a reason.
// Both need a geometry. Both may be null, but depth only together with sigma. write_u16() writes the 16-bit maps.
int postprocess(const PostprocessInput& input, const MapsOut& maps, PostprocessScratch& scratch);

}  // namespace endosdk
