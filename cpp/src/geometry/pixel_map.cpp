#include "geometry/pixel_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "platform/errors.hpp"

namespace endosdk {
namespace {

// OpenCV's five steps end up to a pixel away at the edge of an endoscope's view: Newton's method goes on from there.
constexpr int newton_steps = 4;
constexpr double step_px = 1e-3;  // for slopes by differences
constexpr double same_px = 0.01;

// By each row's heights of covered columns above it.
std::array<int, 4> largest_rectangle(const std::vector<uint8_t>& left, const std::vector<uint8_t>& right, Size size) {
  std::array<int, 4> best{};
  std::vector<int> heights(static_cast<size_t>(size.width) + 1);
  std::vector<std::pair<int, int>> open;  // first column and height, rising
  for (int y = 0; y < size.height; ++y) {
    open.clear();
    for (int x = 0; x <= size.width; ++x) {
      int& height = heights[static_cast<size_t>(x)];
      const size_t i = static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x);
      height = x < size.width && left[i] != 0 && right[i] != 0 ? height + 1 : 0;
      int first = x;
      while (!open.empty() && open.back().second >= height) {
        const auto [column, tall] = open.back();
        open.pop_back();
        first = column;
        if (int64_t{tall} * (x - column) > int64_t{best[2]} * best[3]) best = {column, y - tall + 1, x - column, tall};
      }
      open.emplace_back(first, height);
    }
  }
  return best;
}

}  // namespace

PixelMap::PixelMap(const Rig& rig, double alpha)
    : geometry_(rig.geometry(alpha)),
      rectifies_(!rig.is_rectified()),
      raw_(rig.size()),
      views_{rig.view(false, geometry_), rig.view(true, geometry_)},
      sources_{SourceMap(views_[0]), SourceMap(views_[1])} {}

Point PixelMap::to_raw(Side side, Point rectified) const {
  const SourceMap::Source found = sources_[index(side)].at(rectified.x, rectified.y);
  return found.unfolded ? found.pixel : nowhere;
}

Point PixelMap::to_rectified(Side side, Point raw) const {
  const ViewGeometry& v = views_[index(side)];
  const SourceMap& map = sources_[index(side)];
  const Point ray = unproject(v.camera, raw);
  const Vec3 turned = multiply(v.rotation, Vec3{ray.x, ray.y, 1.0});
  const Mat34& p = v.projection;
  Point found = {p[0] * turned[0] / turned[2] + p[2], p[5] * turned[1] / turned[2] + p[6]};
  for (int i = 0; i < newton_steps; ++i) {
    const Point here = map.at(found.x, found.y).pixel;
    const Point right = map.at(found.x + step_px, found.y).pixel;
    const Point below = map.at(found.x, found.y + step_px).pixel;
    const double a = (right.x - here.x) / step_px, b = (below.x - here.x) / step_px;
    const double c = (right.y - here.y) / step_px, d = (below.y - here.y) / step_px;
    const Point off = {raw.x - here.x, raw.y - here.y};
    const double determinant = a * d - b * c;
    found = {found.x + (d * off.x - b * off.y) / determinant, found.y + (a * off.y - c * off.x) / determinant};
  }
  // Outside the circle that a lens model covers, the steps end anywhere.
  const SourceMap::Source back = map.at(found.x, found.y);
  const bool same = std::hypot(back.pixel.x - raw.x, back.pixel.y - raw.y) <= same_px;  // false for NaN
  return back.unfolded && same ? found : nowhere;
}

Vec3 PixelMap::to_raw_left(const Vec3& point) const { return multiply(transpose(geometry_.views.left_rotation), point); }

std::array<double, 16> PixelMap::q() const {
  if (std::abs(geometry_.focal_px() - geometry_.focal_y_px()) > 1e-6 * geometry_.focal_px()) {
    std::array<double, 16> none;
    none.fill(std::numeric_limits<double>::quiet_NaN());
    return none;
  }
  const double b = geometry_.baseline_mm();
  return {1.0, 0.0, 0.0,     -geometry_.cx(), 0.0, 1.0, 0.0,     -geometry_.cy(),
          0.0, 0.0, 0.0,     geometry_.focal_px(), 0.0, 0.0, 1.0 / b, geometry_.doffs() / b};
}

std::array<int, 4> PixelMap::region() const {
  if (!rectifies_) return {0, 0, raw_.width, raw_.height};
  const auto valid = [&](int view) { return valid_pixels(views_[view], raw_, geometry_.size); };
  return largest_rectangle(valid(0), valid(1), geometry_.size);
}

}  // namespace endosdk
