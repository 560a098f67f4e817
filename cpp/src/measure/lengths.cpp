#include "measure/lengths.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "maps/reasons.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

struct Sighted {
  Vec3 ray;
  double depth;
  double standard_error;
};

Vec3 difference(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

const char* reason_name(uint8_t reasons) {
  for (const ReasonFact& fact : reason_facts) {
    if ((reasons & fact.bit) != 0) return fact.name;
  }
  return "no reason is known";
}

Sighted look(const MeasuredMaps& maps, Point pixel) {
  const bool inside = pixel.x >= -0.5 && pixel.x < maps.size.width - 0.5 && pixel.y >= -0.5 && pixel.y < maps.size.height - 0.5;
  const Text seen(pixel.x, ", ", pixel.y);
  require(inside, "pixel", Text("must lie in the map of ", maps.size), seen);
  const auto index = static_cast<size_t>(std::nearbyint(pixel.y)) * static_cast<size_t>(maps.size.width) +
                     static_cast<size_t>(std::nearbyint(pixel.x));
  const double depth = static_cast<double>(maps.depth[index]);
  require(std::isfinite(depth), "pixel",
          Text("must have a depth; this one has none: ", maps.reasons != nullptr ? reason_name(maps.reasons[index]) : "see the reasons"),
          seen);
  return {maps.sight(pixel), depth, maps.standard_error(index)};
}

// The part of a length's variance that its slope misses: errors across the line always lengthen it.
double curvature_term(const Sighted& a, const Sighted& b, const Vec3& direction, double length, const double covariance[2][2]) {
  if (length <= 0.0) return std::max(0.0, covariance[0][0] + covariance[1][1] - covariance[0][1] - covariance[1][0]);
  const auto across = [&](const Vec3& ray) { return difference(ray, scale(direction, dot(ray, direction))); };
  const Vec3 first = across(a.ray);
  const Vec3 second = across(b.ray);
  const double hessian[2][2] = {{dot(first, first) / length, -dot(first, second) / length},
                                {-dot(first, second) / length, dot(second, second) / length}};
  double moved[2][2];
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) moved[i][j] = hessian[i][0] * covariance[0][j] + hessian[i][1] * covariance[1][j];
  }
  return 0.5 * (moved[0][0] * moved[0][0] + 2.0 * moved[0][1] * moved[1][0] + moved[1][1] * moved[1][1]);
}

}  // namespace

MeasuredPoint point_at(const MeasuredMaps& maps, Point pixel) {
  const Sighted seen = look(maps, pixel);
  MeasuredPoint point{scale(seen.ray, seen.depth), {}};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) point.covariance[3 * i + j] = seen.ray[i] * seen.ray[j] * seen.standard_error * seen.standard_error;
  }
  return point;
}

Measured path_length(const MeasuredMaps& maps, const std::vector<Point>& pixels) {
  require(pixels.size() >= 2 && pixels.size() <= most_pixels, "pixels", Text("must be two or more, and at most ", most_pixels), pixels.size());
  std::vector<Sighted> seen;
  for (const Point& pixel : pixels) seen.push_back(look(maps, pixel));
  const auto covariance = [&](size_t i, size_t j) {
    const double apart = std::hypot(pixels[i].x - pixels[j].x, pixels[i].y - pixels[j].y);
    return mean_square_share * seen[i].standard_error * seen[j].standard_error * std::exp(-apart / maps.correlation_length());
  };
  Measured length;
  double variance = 0.0;
  std::vector<double> slope(pixels.size());
  for (size_t i = 0; i + 1 < pixels.size(); ++i) {
    const Vec3 step = difference(scale(seen[i + 1].ray, seen[i + 1].depth), scale(seen[i].ray, seen[i].depth));
    const double far = norm(step);
    const Vec3 direction = far > 0.0 ? scale(step, 1.0 / far) : Vec3{};
    length.value += far;
    slope[i] -= dot(direction, seen[i].ray);
    slope[i + 1] += dot(direction, seen[i + 1].ray);
    const double pair[2][2] = {{covariance(i, i), covariance(i, i + 1)}, {covariance(i + 1, i), covariance(i + 1, i + 1)}};
    variance += curvature_term(seen[i], seen[i + 1], direction, far, pair);
  }
  for (size_t i = 0; i < pixels.size(); ++i) {
    for (size_t j = 0; j < pixels.size(); ++j) variance += slope[i] * slope[j] * covariance(i, j);
  }
  length.standard_error = std::sqrt(variance);
  return length;
}

}  // namespace endosdk
