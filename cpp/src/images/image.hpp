// Views of pixels that the caller owns, and the planar layout that the network reads.
#pragma once

#include <cstddef>
#include <cstdint>

#include "images/size.hpp"

namespace endosdk {

enum class ChannelOrder { rgb, bgr, gray };

// Interleaved 8-bit rows with three channels, or one for gray. The stride between rows is any number of bytes, also negative.
struct ImageView {
  const uint8_t* data = nullptr;
  int width = 0;
  int height = 0;
  int channels = 0;
  ptrdiff_t stride = 0;

  Size size() const { return {width, height}; }
  const uint8_t* row(int y) const { return data + y * stride; }
};

// Three contiguous planes, red first. Each has the padded size of the network's input.
struct PlanarView {
  uint8_t* data = nullptr;
  int width = 0;
  int height = 0;

  Size size() const { return {width, height}; }
  uint8_t* row(int plane, int y) const {
    return data + (static_cast<ptrdiff_t>(plane) * height + y) * width;
  }
};

// Destination rows for channels 0, 1 and 2 of a source with this channel order. The planes come out red first.
struct PlaneRows {
  uint8_t* channel[3];

  PlaneRows(const PlanarView& out, ChannelOrder order, int y);
};

void check_source(const ImageView& image, ChannelOrder order, const char* name);
void check_planar(const PlanarView& out, int min_width, int min_height, const char* name);

// Writes the top left part of the planes as contiguous RGB rows. Does nothing if `to` is null.
void copy_interleaved(const PlanarView& from, Size size, uint8_t* to);

// Repeats the last picture column of row y up to the padded width.
void pad_right(const PlanarView& out, int width, int y);

// Repeats the last picture row down to the padded height.
void pad_bottom(const PlanarView& out, int height);

// Writes one pair of rectified frames as padded planes.
void pack(const ImageView& left, const ImageView& right, const PlanarView& out_left, const PlanarView& out_right,
          ChannelOrder order);

}  // namespace endosdk
