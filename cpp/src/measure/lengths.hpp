// Points and lengths in the maps of a frame, with their standard errors.
//
// sigma is the scale of a Laplace law. The standard error of a depth is that law's standard deviation: its interval of 95 %
// holds. Of a difference of two depths the mean square of errors counts, which is less. Errors of two pixels are correlated,
// exp(-r / L) at r pixels: the network looks at windows, so what misleads it at one pixel misleads it nearby. Errors of the
// calibration are in neither: they scale or bend all lengths together.
#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/linear.hpp"
#include "images/size.hpp"

namespace endosdk {

// L as a share of the map's width, and the mean square of errors in units of that of the standard error: fitted on rendered
// training scenes, where the error of each pixel is known.
constexpr double correlation_share = 0.021;
constexpr double mean_square_share = 0.45;

// Of a line or a polygon: what they take grows with the square, to two seconds.
constexpr size_t most_pixels = 10'000;

// The maps of one frame and the camera that they belong to. Reasons may be null.
struct MeasuredMaps {
  Size size;
  const float* depth = nullptr;
  const float* sigma = nullptr;
  const uint8_t* reasons = nullptr;
  double focal_x = 0.0;
  double focal_y = 0.0;
  double cx = 0.0;
  double cy = 0.0;

  double standard_error(size_t index) const { return std::numbers::sqrt2 * static_cast<double>(sigma[index]); }

  double correlation_length() const { return correlation_share * size.width; }

  // The line of sight of a pixel, with z = 1.
  Vec3 sight(Point pixel) const { return {(pixel.x - cx) / focal_x, (pixel.y - cy) / focal_y, 1.0}; }
};

struct Measured {
  double value = 0.0;
  double standard_error = 0.0;
};

// In the rectified left camera's frame, mm and mm squared.
struct MeasuredPoint {
  Vec3 xyz;
  Mat3 covariance;
};

// What a pixel shows; the map's pixel whose centre is nearest counts. Refuses one outside the map or without depth.
MeasuredPoint point_at(const MeasuredMaps& maps, Point pixel);

// The length of the line through the points at two pixels or more.
Measured path_length(const MeasuredMaps& maps, const std::vector<Point>& pixels);

}  // namespace endosdk
