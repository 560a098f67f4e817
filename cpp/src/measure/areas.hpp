// The area inside a polygon, and how far the surface stands out of its plane.
#pragma once

#include <vector>

#include "measure/lengths.hpp"

namespace endosdk {

constexpr int least_area_pixels = 30;  // with depth, for a plane
constexpr double least_area_coverage = 0.5;  // with less, the plane is a guess at what nobody saw

// What a polygon encloses. `flat`, mm squared, is the area of its outline on the plane that fits the surface inside best:
// what a ruler on a print of it would give. `relief`, mm, is how far the surface reaches from its lowest to its highest place
// across that plane, without the outermost 5 % of the pixels. `coverage` is the share of pixels inside that have a depth.
struct MeasuredArea {
  Measured flat;
  Measured relief;
  double coverage = 0.0;
};

// A pixel is inside when its centre is. Refuses polygons that leave the map, cross themselves, hold too few pixels with depth, or
// reach where the plane through these is not in front of the camera.
MeasuredArea area(const MeasuredMaps& maps, const std::vector<Point>& polygon);

}  // namespace endosdk
