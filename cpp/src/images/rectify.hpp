// Rectification: turns the raw interleaved frames of both views into padded planar RGB, in one call.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/stereo_rectify.hpp"
#include "images/image.hpp"
#include "images/reduce.hpp"
#include "images/size.hpp"

namespace endosdk {

// How a position on an outermost pixel, but beyond its centre, is read. `fading` mixes the pixel with black, as
// cv2.remap does with a constant border. `whole` takes the pixel alone. Outside the picture everything is black.
enum class Border { fading, whole };

// The picture that a map reads.
struct MapSource {
  Size size;
  double width = 0.0;  // px of this picture that hold raw pixels; less than its size if the last block is not full
  double height = 0.0;
  Border border = Border::fading;
};

// The map of one view, kept in the form that the kernels read. Positions are rounded to 1/128 px.
class ViewMap {
 public:
  ViewMap(const ViewGeometry& view, const MapSource& source, Size rectified);

  void rectify_row(const ImageView& source, ChannelOrder order, int y, const PlanarView& out) const;

  // 1 where the source position lies inside the raw image and the lens model is one-to-one.
  const std::vector<uint8_t>& valid() const { return valid_; }

 private:
  enum class Kind : uint8_t {
    inside,   // all neighbours exist: vector kernels
    edge,     // some neighbours are missing, or lie too near the end of a row for the kernels
    outside,  // black
  };
  struct Span {
    int begin;
    int end;
    Kind kind;
  };

  Kind place(Point position, const MapSource& source, size_t index);
  void build_row(const SourceMap& map, const MapSource& source, int y, Kind* kinds);
  void remap_edge(const ImageView& source, size_t row, Span span, uint8_t* const planes[3]) const;

  Size size_;
  std::vector<uint32_t> corner_;
  std::vector<uint16_t> fraction_;
  std::vector<uint8_t> valid_;
  std::vector<Span> spans_;
  std::vector<size_t> row_spans_;  // spans of row y: row_spans_[y] to row_spans_[y + 1]
};

// The same masks for a rectified picture at least half as large as the raw one, without a map. Row by row.
std::vector<uint8_t> valid_pixels(const ViewGeometry& view, Size raw, Size rectified);

// Scratch memory for one frame. It is kept between frames, so that a frame allocates nothing.
struct RectifyScratch {
  ReducedFrame left, right;
};

// A rectifier is immutable, so one object may serve several threads, each with its own scratch memory. A frame at least twice
// as large as the rectified picture is first reduced by a whole factor, so that sampling skips no detail. Then `Border::whole`
// is used, because fading would reach over a block of raw pixels.
class Rectifier {
 public:
  Rectifier(Size raw, Size rectified, const ViewGeometry& left, const ViewGeometry& right, Border border);

  // Writes each rectified picture into the top left of its output, and repeats its last column and row over the padding.
  void rectify(const ImageView& left, const ImageView& right, const PlanarView& out_left, const PlanarView& out_right,
               ChannelOrder order, RectifyScratch& scratch) const;

  Size rectified_size() const { return rectified_; }
  const std::vector<uint8_t>& valid_left() const { return left_.valid(); }
  const std::vector<uint8_t>& valid_right() const { return right_.valid(); }

 private:
  Size raw_;
  Size rectified_;
  int factor_;
  ViewMap left_;
  ViewMap right_;
};

}  // namespace endosdk
