// Measuring, as Python functions of arrays.
#include <tuple>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "measure/areas.hpp"
#include "geometry/pixel_map.hpp"
#include "rigs.hpp"

namespace endosdk {
namespace {

// Focal lengths along x and y, and principal point.
using CameraNumbers = std::tuple<double, double, double, double>;

// The maps of one frame. The arrays must live until the measurement is done.
MeasuredMaps maps_of(const py::array& depth, const py::array& sigma, const py::array& reasons, const CameraNumbers& camera) {
  const FloatView seen = float_view<float>(depth, "depth");
  MeasuredMaps maps;
  maps.size = {seen.width, seen.height};
  maps.depth = seen.data;
  maps.sigma = map_of<float>(sigma, maps.size, "sigma");
  maps.reasons = map_of<uint8_t>(reasons, maps.size, "reasons");
  std::tie(maps.focal_x, maps.focal_y, maps.cx, maps.cy) = camera;
  return maps;
}

// Frames of a Python session need the interpreter: what may take long must not hold it.
template <typename Work>
auto unlocked(const Work& work) {
  const py::gil_scoped_release release;
  return work();
}

std::vector<Point> points_of(const Doubles& pixels) {
  std::vector<Point> points(static_cast<size_t>(pixels.shape(0)));
  for (size_t i = 0; i < points.size(); ++i) points[i] = {pixels.data()[2 * i], pixels.data()[2 * i + 1]};
  return points;
}

template <typename Turn>
Doubles turned(const Doubles& pixels, const Turn& turn) {
  const auto count = static_cast<size_t>(pixels.shape(0));
  py::array_t<double> out({pixels.shape(0), py::ssize_t{2}});
  const double* const from = pixels.data();
  double* const to = out.mutable_data();
  unlocked([&] {
    for (size_t i = 0; i < count; ++i) {
      const Point found = turn(Point{from[2 * i], from[2 * i + 1]});
      to[2 * i] = found.x;
      to[2 * i + 1] = found.y;
    }
  });
  return out;
}

template <size_t Count>
Doubles matrix(const std::array<double, Count>& values, py::ssize_t rows) {
  py::array_t<double> out({rows, static_cast<py::ssize_t>(Count) / rows});
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}

void bind_lengths(py::module_& m) {
  using py::arg;
  m.attr("correlation_share") = correlation_share;
  m.attr("mean_square_share") = mean_square_share;
  m.def(
      "point_at",
      [](const py::array& depth, const py::array& sigma, const py::array& reasons, const CameraNumbers& camera, double x, double y) {
        const MeasuredPoint found = unlocked([&, maps = maps_of(depth, sigma, reasons, camera)] { return point_at(maps, {x, y}); });
        return py::make_tuple(matrix(found.xyz, 1), matrix(found.covariance, 3));
      },
      arg("depth"), arg("sigma"), arg("reasons"), arg("camera"), arg("x"), arg("y"));
  m.def(
      "path_length",
      [](const py::array& depth, const py::array& sigma, const py::array& reasons, const CameraNumbers& camera, const Doubles& pixels) {
        const Measured found = unlocked([maps = maps_of(depth, sigma, reasons, camera), points = points_of(pixels)] {
          return path_length(maps, points);
        });
        return std::make_tuple(found.value, found.standard_error);
      },
      arg("depth"), arg("sigma"), arg("reasons"), arg("camera"), arg("pixels"));
  m.def(
      "area",
      [](const py::array& depth, const py::array& sigma, const py::array& reasons, const CameraNumbers& camera, const Doubles& polygon) {
        const MeasuredArea found = unlocked([maps = maps_of(depth, sigma, reasons, camera), points = points_of(polygon)] {
          return area(maps, points);
        });
        return std::make_tuple(found.flat.value, found.flat.standard_error, found.relief.value, found.relief.standard_error,
                               found.coverage);
      },
      arg("depth"), arg("sigma"), arg("reasons"), arg("camera"), arg("polygon"));
}

void bind_pixels(py::module_& m) {
  using py::arg;
  py::class_<PixelMap>(m, "PixelMap", "Raw and rectified pixels of one rig.")
      .def(py::init([](const RigNumbers& rig, double alpha) { return PixelMap(rig_of(rig), alpha); }), arg("rig"), arg("alpha"))
      .def("to_raw",
           [](const PixelMap& map, bool right, const Doubles& pixels) {
             return turned(pixels, [&](Point p) { return map.to_raw(right ? Side::right : Side::left, p); });
           })
      .def("to_rectified",
           [](const PixelMap& map, bool right, const Doubles& pixels) {
             return turned(pixels, [&](Point p) { return map.to_rectified(right ? Side::right : Side::left, p); });
           })
      .def("region", &PixelMap::region);
}

}  // namespace

void bind_measure(py::module_& m) {
  bind_lengths(m);
  bind_pixels(m);
}

}  // namespace endosdk
