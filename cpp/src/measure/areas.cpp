#include "measure/areas.hpp"

#include <algorithm>
#include <cmath>

#include "platform/errors.hpp"

namespace endosdk {
namespace {

// L of the mean over a whole surface, longer than that of two pixels: a weak part of the errors goes on over an object.
constexpr double plane_correlation_share = 0.05;

constexpr double least_nearness_errors = 1.0;  // of a corner on the plane: nearer to the horizon its own error means nothing

constexpr size_t most_fitted = 600;  // neighbouring pixels hardly know more than one of them

// Multiples of it, without their whole part, are spread over 0 to 1 at any number of them.
constexpr double golden = 0.6180339887498949;

// Standard error of the relief over that of a pixel: the extremes of many pixels stray further than one does. With it,
// 95 % intervals cover about that share of the reliefs of rendered training scenes.
constexpr double relief_factor = 2.3;
constexpr double lowest_share = 0.025, highest_share = 0.975;  // of the heights: single wrong pixels are no relief

struct Seen {
  Point pixel;
  double depth;
  double standard_error;
};

// 1 / depth, the nearness, = terms . (1, x, y), which is a plane in space; x and y are pixels from the origin.
struct Plane {
  Vec3 terms;
  Mat3 covariance;
  Point origin;

  Vec3 factors(Point pixel) const { return {1.0, pixel.x - origin.x, pixel.y - origin.y}; }
  double nearness(Point pixel) const { return dot(terms, factors(pixel)); }
  double nearness_error(Point pixel) const { return std::sqrt(dot(factors(pixel), multiply(covariance, factors(pixel)))); }
  double depth(Point pixel) const { return 1.0 / nearness(pixel); }
};

// On which side of the line from a to b a point lies.
double side_of(const Point& a, const Point& b, const Point& p) { return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x); }

bool segments_cross(const Point& a, const Point& b, const Point& c, const Point& d) {
  return side_of(a, b, c) * side_of(a, b, d) < 0.0 && side_of(c, d, a) * side_of(c, d, b) < 0.0;
}

bool same(const Point& a, const Point& b) { return a.x == b.x && a.y == b.y; }

bool lies_on(const Point& a, const Point& b, const Point& p) {
  return side_of(a, b, p) == 0.0 && (p.x - a.x) * (p.x - b.x) + (p.y - a.y) * (p.y - b.y) <= 0.0;
}

// Whether a point lies left of the way from a over p to b; 0 if it lies on it.
int left_of_way(const Point& a, const Point& p, const Point& b, const Point& point) {
  const double first = side_of(a, p, point);
  const double second = side_of(p, b, point);
  const double bend = side_of(a, p, b);
  if (bend > 0.0 ? (first > 0.0 && second > 0.0) : (first > 0.0 || second > 0.0)) return 1;
  return bend > 0.0 ? (first < 0.0 || second < 0.0 ? -1 : 0) : (first < 0.0 && second < 0.0 ? -1 : 0);
}

// Whether an outline goes through the way from a over p to b at p. One that touches it, or goes along with it, does not.
bool goes_through(const Point& a, const Point& p, const Point& b, const Point& before, const Point& after) {
  return left_of_way(a, p, b, before) * left_of_way(a, p, b, after) < 0;
}

void check_polygon(const MeasuredMaps& maps, const std::vector<Point>& polygon) {
  require(polygon.size() >= 3 && polygon.size() <= most_pixels, "polygon", Text("must be 3 to ", most_pixels, " pixels"),
          polygon.size());
  for (const Point& p : polygon) {
    const bool inside = p.x >= -0.5 && p.y >= -0.5 && p.x <= maps.size.width - 0.5 && p.y <= maps.size.height - 0.5;
    require(inside, "polygon", Text("must lie in the map of ", maps.size), Text(p.x, ", ", p.y));
  }
  // Where the outline crosses itself, nobody can say what is inside.
  const size_t count = polygon.size();
  const auto corner = [&](size_t i) { return polygon[i % count]; };
  for (size_t i = 0; i < count; ++i) {
    for (size_t k = i + 2; k < count; ++k) {
      const bool crossed = segments_cross(corner(i), corner(i + 1), corner(k), corner(k + 1));
      require(!crossed, "polygon", "must not cross itself", Text("lines ", i, " and ", k));
    }
    for (size_t k = 0; k < count; ++k) {
      const Point p = corner(k);
      if (k == i || k == (i + 1) % count || !lies_on(corner(i), corner(i + 1), p) || same(p, corner(i + 1))) continue;
      const Point from = same(p, corner(i)) ? corner(i + count - 1) : corner(i);
      const bool crossed = goes_through(from, p, corner(i + 1), corner(k + count - 1), corner(k + 1));
      require(!crossed, "polygon", "must not cross itself", Text("line ", i, " and corner ", k));
    }
  }
}

// The places where a row of pixel centres crosses the outline, from left to right.
std::vector<double> crossings(const std::vector<Point>& polygon, int row) {
  std::vector<double> found;
  const double y = row;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Point& a = polygon[i];
    const Point& b = polygon[(i + 1) % polygon.size()];
    if ((a.y <= y) != (b.y <= y)) found.push_back(a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y));
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<Seen> pixels_inside(const MeasuredMaps& maps, const std::vector<Point>& polygon, int64_t& total) {
  std::vector<Seen> seen;
  for (int y = 0; y < maps.size.height; ++y) {
    const std::vector<double> at = crossings(polygon, y);
    for (size_t k = 0; k + 1 < at.size(); k += 2) {
      const int last = std::min(static_cast<int>(std::ceil(at[k + 1])) - 1, maps.size.width - 1);
      for (int x = std::max(static_cast<int>(std::ceil(at[k])), 0); x <= last; ++x) {
        const size_t i = static_cast<size_t>(y) * static_cast<size_t>(maps.size.width) + static_cast<size_t>(x);
        ++total;
        if (std::isfinite(maps.depth[i])) {
          seen.push_back({{static_cast<double>(x), static_cast<double>(y)}, static_cast<double>(maps.depth[i]), maps.standard_error(i)});
        }
      }
    }
  }
  return seen;
}

// Least squares over some pixels, spread evenly; their errors are correlated, which the covariance knows.
Plane fit(const std::vector<Seen>& seen, double correlation_length) {
  Plane plane{};
  for (const Seen& s : seen) {
    plane.origin.x += s.pixel.x / static_cast<double>(seen.size());
    plane.origin.y += s.pixel.y / static_cast<double>(seen.size());
  }
  const size_t count = std::min(seen.size(), most_fitted);
  std::vector<Vec3> rows(count);
  std::vector<Point> places(count);
  Mat3 normal{};
  Vec3 target{};
  for (size_t i = 0; i < count; ++i) {
    // One of every stretch of the pixels. Always the same place of a stretch would be one column, if a stretch is a row.
    const double place = static_cast<double>(i) + std::fmod(static_cast<double>(i) * golden, 1.0);
    const Seen& s = seen[static_cast<size_t>(place * static_cast<double>(seen.size()) / static_cast<double>(count))];
    const double weight = s.depth * s.depth / s.standard_error;  // 1 over the standard error of 1 / depth
    places[i] = s.pixel;
    rows[i] = {weight, weight * (s.pixel.x - plane.origin.x), weight * (s.pixel.y - plane.origin.y)};
    for (size_t r = 0; r < 3; ++r) {
      for (size_t c = 0; c < 3; ++c) normal[3 * r + c] += rows[i][r] * rows[i][c];
      target[r] += rows[i][r] * weight / s.depth;
    }
  }
  const double flatness = determinant(normal) / (normal[0] * normal[4] * normal[8]);
  require(flatness > 1e-9, "polygon", "must hold pixels with depth that do not lie on one line", Text(seen.size(), " pixels on a line"));
  const Mat3 inverted = inverse(normal);
  plane.terms = multiply(inverted, target);
  Mat3 spread{};
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j < count; ++j) {
      const double together = std::exp(-std::hypot(places[i].x - places[j].x, places[i].y - places[j].y) / correlation_length);
      for (size_t r = 0; r < 3; ++r) {
        for (size_t c = 0; c < 3; ++c) spread[3 * r + c] += together * rows[i][r] * rows[j][c];
      }
    }
  }
  plane.covariance = multiply(multiply(inverted, spread), inverted);
  return plane;
}

// Where depth is missing, the plane goes on as it likes. A line of sight towards its horizon, or past it, never meets it.
void check_before_horizon(const std::vector<Point>& polygon, const Plane& plane) {
  for (const Point& corner : polygon) {
    require(plane.nearness(corner) > least_nearness_errors * plane.nearness_error(corner), "polygon",
            "must end before the horizon of the plane through its depths; leave out what has no depth",
            Text("the corner ", corner.x, ", ", corner.y));
  }
}

// Of the polygon where its lines of sight meet the plane.
double flat_area(const MeasuredMaps& maps, const std::vector<Point>& polygon, const Plane& plane) {
  Vec3 sum{};
  const auto corner = [&](size_t i) {
    const Point& p = polygon[i % polygon.size()];
    return scale(maps.sight(p), plane.depth(p));
  };
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vec3 part = cross(corner(i), corner(i + 1));
    for (size_t k = 0; k < 3; ++k) sum[k] += part[k];
  }
  return 0.5 * norm(sum);
}

Measured flat(const MeasuredMaps& maps, const std::vector<Point>& polygon, const Plane& plane) {
  const double value = flat_area(maps, polygon, plane);
  Vec3 slope{};
  const double share[3] = {1.0, 1e-2, 1e-2};
  for (size_t i = 0; i < 3; ++i) {
    Plane moved = plane;
    const double step = 1e-6 * std::abs(plane.terms[0]) * share[i];
    moved.terms[i] += step;
    slope[i] = (flat_area(maps, polygon, moved) - value) / step;
  }
  return {value, std::sqrt(dot(slope, multiply(plane.covariance, slope)))};
}

// As numpy.percentile gives it; the values are sorted.
double quantile(const std::vector<double>& values, double share) {
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
}

Measured relief(const MeasuredMaps& maps, const std::vector<Seen>& seen, const Plane& plane) {
  Vec3 normal = {plane.terms[1] * maps.focal_x, plane.terms[2] * maps.focal_y,
                 plane.terms[0] + plane.terms[1] * (maps.cx - plane.origin.x) + plane.terms[2] * (maps.cy - plane.origin.y)};
  normal = scale(normal, 1.0 / norm(normal));
  std::vector<double> heights, errors;
  for (const Seen& s : seen) {
    const double towards = dot(maps.sight(s.pixel), normal);
    heights.push_back((s.depth - plane.depth(s.pixel)) * towards);
    errors.push_back(s.standard_error * std::abs(towards));
  }
  std::sort(heights.begin(), heights.end());
  std::sort(errors.begin(), errors.end());
  return {quantile(heights, highest_share) - quantile(heights, lowest_share), relief_factor * quantile(errors, 0.5)};
}

}  // namespace

MeasuredArea area(const MeasuredMaps& maps, const std::vector<Point>& polygon) {
  check_polygon(maps, polygon);
  int64_t total = 0;
  const std::vector<Seen> seen = pixels_inside(maps, polygon, total);
  require(seen.size() >= least_area_pixels, "polygon", Text("must hold ", least_area_pixels, " pixels with depth or more"), seen.size());
  const double coverage = static_cast<double>(seen.size()) / static_cast<double>(total);
  require(coverage >= least_area_coverage, "polygon", "must hold depth on half of its pixels or more", coverage);
  const Plane plane = fit(seen, plane_correlation_share * maps.size.width);
  check_before_horizon(polygon, plane);
  return {flat(maps, polygon, plane), relief(maps, seen, plane), coverage};
}

}  // namespace endosdk
