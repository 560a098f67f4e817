// The functions of endosdk.h that measure: the rig and the result come with each call.
#include <endosdk/endosdk.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "library/capi_structs.hpp"
#include "library/guarded.hpp"
#include "library/struct_io.hpp"
#include "measure/areas.hpp"
#include "geometry/pixel_map.hpp"
#include "platform/threads.hpp"

using endosdk::guarded;
using endosdk::require;
using endosdk::require_pointer;

namespace {

endosdk::Rig rig_of(const endo_calibration* calibration) {
  require_pointer(calibration, "calibration");
  return endosdk::read_rig(*calibration);
}

// A result that says which rig it was computed with must be measured with that one: another gives other millimetres.
void check_same_rig(const endosdk::Rig& rig, const endo_identity& identity) {
  const char* const stated = identity.calibration_sha256;
  const std::string computed_with(stated, std::find(stated, stated + sizeof identity.calibration_sha256, '\0'));
  if (computed_with.empty()) return;
  const std::string& given = rig.sha256();
  require(given == computed_with, "calibration", endosdk::Text("must be the one that the result was computed with, of sha256 ", computed_with),
          given);
}

endosdk::MeasuredMaps maps_of(const endosdk::Rig& rig, const endo_result* result) {
  const endo_result known = endosdk::read_result(result);
  check_same_rig(rig, known.identity);
  require_pointer(known.depth, "result.depth");
  require_pointer(known.sigma, "result.sigma");
  const endosdk::Size size = rig.size();
  const uint64_t pixels = static_cast<uint64_t>(size.width) * static_cast<uint64_t>(size.height);
  require(known.capacity >= pixels, "result.capacity", endosdk::Text("must be at least ", pixels, " pixels"), known.capacity);
  const endosdk::RectifiedGeometry& g = rig.geometry();
  return {size, known.depth, known.sigma, known.reasons, g.focal_px(), g.views.left_projection[5], g.cx(), g.cy()};
}

// Memory of so many pixels or points; no memory is needed for none.
void require_values(const double* values, size_t count, const char* argument) {
  if (count > 0) require_pointer(values, argument);
}

std::vector<endosdk::Point> pixels_of(const double* pixels, size_t count) {
  require_values(pixels, count, "pixels");
  require(count <= endosdk::most_pixels, "count", endosdk::Text("must be at most ", endosdk::most_pixels), count);
  std::vector<endosdk::Point> points(count);
  for (size_t i = 0; i < count; ++i) points[i] = {pixels[2 * i], pixels[2 * i + 1]};
  return points;
}

// Sizes of the structs in the first release; they only grow.
constexpr size_t first_measured = 24;
constexpr size_t first_point = 104;
constexpr size_t first_area = 48;
constexpr size_t first_rectification = 488;
static_assert(sizeof(endo_measured) >= first_measured && sizeof(endo_point) >= first_point && sizeof(endo_area) >= first_area &&
              sizeof(endo_rectification) >= first_rectification);

// The caller's struct of answers: what it says of itself, checked before anything is computed.
template <typename Struct>
Struct checked(const Struct* answer, size_t first, const char* argument) {
  const Struct known = endosdk::read_struct(answer, first, argument);
  require(known.reserved == 0, endosdk::Text(argument, ".reserved"), "must be 0", known.reserved);
  return known;
}

template <typename Struct>
void write(const Struct& known, Struct* answer) {
  endosdk::write_struct(known, known.struct_size, answer);
}

void check_alpha(double alpha) { require(std::isfinite(alpha) && alpha <= 1.0, "alpha", "must be a number of at most 1", alpha); }

template <typename Turn>
endo_status turn_pixels(const endo_calibration* calibration, double alpha, int32_t right, const double* pixels, size_t count,
                        double* out, const Turn& turn) {
  return guarded([&] {
    const endosdk::Rig rig = rig_of(calibration);
    check_alpha(alpha);
    require(right == 0 || right == 1, "right", "must be 0 or 1", right);
    require_values(pixels, count, "pixels");
    require_values(out, count, "output");
    const endosdk::PixelMap map(rig, alpha);
    const endosdk::Side side = right == 1 ? endosdk::Side::right : endosdk::Side::left;
    for (size_t i = 0; i < count; ++i) {
      const endosdk::Point found = turn(map, side, {pixels[2 * i], pixels[2 * i + 1]});
      out[2 * i] = found.x;
      out[2 * i + 1] = found.y;
    }
  });
}

}  // namespace

extern "C" {

endo_status endo_point_at(const endo_calibration* calibration, const endo_result* result, double x, double y, endo_point* point) {
  return guarded([&] {
    endo_point known = checked(point, first_point, "point");
    const endosdk::Rig rig = rig_of(calibration);
    const endosdk::MeasuredPoint found = endosdk::point_at(maps_of(rig, result), {x, y});
    std::copy(found.xyz.begin(), found.xyz.end(), known.xyz);
    std::copy(found.covariance.begin(), found.covariance.end(), known.covariance);
    write(known, point);
  });
}

endo_status endo_path_length(const endo_calibration* calibration, const endo_result* result, const double* pixels, size_t count,
                             endo_measured* length) {
  return guarded([&] {
    endo_measured known = checked(length, first_measured, "length");
    const endosdk::Rig rig = rig_of(calibration);
    const endosdk::Measured found = endosdk::path_length(maps_of(rig, result), pixels_of(pixels, count));
    known.value = found.value;
    known.standard_error = found.standard_error;
    write(known, length);
  });
}

endo_status endo_area_inside(const endo_calibration* calibration, const endo_result* result, const double* pixels, size_t count,
                             endo_area* area) {
  return guarded([&] {
    endo_area known = checked(area, first_area, "area");
    const endosdk::Rig rig = rig_of(calibration);
    const endosdk::MeasuredArea found = endosdk::area(maps_of(rig, result), pixels_of(pixels, count));
    known.flat = found.flat.value;
    known.flat_standard_error = found.flat.standard_error;
    known.relief = found.relief.value;
    known.relief_standard_error = found.relief.standard_error;
    known.coverage = found.coverage;
    write(known, area);
  });
}

endo_status endo_get_rectification(const endo_calibration* calibration, double alpha, endo_rectification* rectification) {
  return guarded([&] {
    endo_rectification known = checked(rectification, first_rectification, "rectification");
    const endosdk::Rig rig = rig_of(calibration);
    check_alpha(alpha);
    const endosdk::LoopThreads alone(1);  // no estimator is asked, so no host's hook would be called
    const endosdk::PixelMap map(rig, alpha);
    const endosdk::Rectification& views = map.geometry().views;
    const auto q = map.q();
    const auto region = map.region();
    std::copy(region.begin(), region.end(), known.region);
    std::copy(views.left_rotation.begin(), views.left_rotation.end(), known.left_rotation);
    std::copy(views.right_rotation.begin(), views.right_rotation.end(), known.right_rotation);
    std::copy(views.left_projection.begin(), views.left_projection.end(), known.left_projection);
    std::copy(views.right_projection.begin(), views.right_projection.end(), known.right_projection);
    std::copy(q.begin(), q.end(), known.q);
    write(known, rectification);
  });
}

endo_status endo_raw_to_rectified(const endo_calibration* calibration, double alpha, int32_t right, const double* pixels,
                                  size_t count, double* rectified) {
  const auto turn = [](const endosdk::PixelMap& map, endosdk::Side side, endosdk::Point pixel) { return map.to_rectified(side, pixel); };
  return turn_pixels(calibration, alpha, right, pixels, count, rectified, turn);
}

endo_status endo_rectified_to_raw(const endo_calibration* calibration, double alpha, int32_t right, const double* pixels,
                                  size_t count, double* raw) {
  const auto turn = [](const endosdk::PixelMap& map, endosdk::Side side, endosdk::Point pixel) { return map.to_raw(side, pixel); };
  return turn_pixels(calibration, alpha, right, pixels, count, raw, turn);
}

endo_status endo_to_raw_left(const endo_calibration* calibration, const double* points, size_t count, double* raw) {
  return guarded([&] {
    const endosdk::Rig rig = rig_of(calibration);
    require_values(points, count, "points");
    require_values(raw, count, "output");
    const endosdk::PixelMap map(rig, 0.0);
    for (size_t i = 0; i < count; ++i) {
      const endosdk::Vec3 turned = map.to_raw_left({points[3 * i], points[3 * i + 1], points[3 * i + 2]});
      std::copy(turned.begin(), turned.end(), raw + 3 * i);
    }
  });
}

}  // extern "C"
