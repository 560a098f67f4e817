// Turns NumPy arrays into views of the core. Types, shapes and strides are checked, and nothing is copied.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <limits>
#include <optional>
#include <string>

#include "geometry/pose_error.hpp"
#include "images/image.hpp"
#include "images/resize.hpp"
#include "images/size.hpp"
#include "maps/maps.hpp"
#include "platform/errors.hpp"

namespace endosdk {

namespace py = pybind11;

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using OptionalArray = std::optional<py::array>;

inline std::string shape_text(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t i = 0; i < array.ndim(); ++i) text += (i ? ", " : "") + std::to_string(array.shape(i));
  return text + ")";
}

inline int side(py::ssize_t length, const char* name) {
  require(length <= std::numeric_limits<int>::max() / 4, name, "is too large", length);
  return static_cast<int>(length);
}

template <typename Type>
void require_type(const py::array& array, const char* name) {
  require(py::isinstance<py::array_t<Type>>(array), name, "must be " + std::string(py::str(py::dtype::of<Type>())),
          std::string(py::str(array.dtype())));
}

inline void require_contiguous(const py::array& array, const char* name) {
  require((array.flags() & py::array::c_style) != 0, name, "must be C-contiguous", "strides of another order");
}

template <typename Type>
FloatView float_view(const py::array& array, const char* name) {
  require_type<Type>(array, name);
  require(array.ndim() == 2, name, "must have shape [height, width]", shape_text(array));
  require_contiguous(array, name);
  return {static_cast<const float*>(array.data()), side(array.shape(1), name), side(array.shape(0), name)};
}

// The memory of an output array.
inline void* writable(py::array& array, const char* name) {
  require(array.writeable(), name, "must be writable", "a read-only array");
  return array.mutable_data();
}

inline MutableFloatView float_output(py::array& array, const char* name) {
  const FloatView view = float_view<float>(array, name);
  return {static_cast<float*>(writable(array, name)), view.width, view.height};
}

// The memory of an optional map, which must have the size of the outputs; null if it is None.
template <typename Type>
const Type* map_of(const OptionalArray& array, Size size, const char* name) {
  if (!array) return nullptr;
  require_type<Type>(*array, name);
  require(array->ndim() == 2 && array->shape(0) == size.height && array->shape(1) == size.width, name,
          Text("must be of shape (", size.height, ", ", size.width, ")"), shape_text(*array));
  require_contiguous(*array, name);
  return static_cast<const Type*>(array->data());
}

template <typename Type>
Type* map_output(OptionalArray& array, Size size, const char* name) {
  if (map_of<Type>(array, size, name) == nullptr) return nullptr;
  return static_cast<Type*>(writable(*array, name));
}

// The memory of the maps that the caller wants, in the order of map_fields. An unwanted map is None, or missing at the end.
inline MapsOut maps_out(const py::tuple& arrays, Size size) {
  MapsOut out;
  size_t next = 0;
  for_each_map([&](const auto& field) {
    using Value = typename std::decay_t<decltype(field)>::Value;
    if (next == arrays.size()) return;
    auto array = py::cast<OptionalArray>(arrays[next++]);
    out.*field.memory = map_output<Value>(array, size, field.name);
  });
  return out;
}

inline ImageView image_view(const py::array& array, const char* name) {
  require_type<uint8_t>(array, name);
  const bool flat = array.ndim() == 2;
  require(flat || array.ndim() == 3, name, "must have shape [height, width, channels]", shape_text(array));
  const int channels = flat ? 1 : side(array.shape(2), name);
  const bool packed = (array.shape(1) <= 1 || array.strides(1) == channels) &&
                      (flat || channels <= 1 || array.strides(2) == 1);
  require(packed || array.size() == 0, name, "pixels of a row must be contiguous", "other strides");
  return {static_cast<const uint8_t*>(array.data()), side(array.shape(1), name), side(array.shape(0), name), channels,
          array.strides(0)};
}

inline PlanarView planar_view(const py::array& array, void* data, const char* name) {
  require_type<uint8_t>(array, name);
  require(array.ndim() == 3 && array.shape(0) == 3, name, "must have shape [3, height, width]", shape_text(array));
  require_contiguous(array, name);
  return {static_cast<uint8_t*>(data), side(array.shape(2), name), side(array.shape(1), name)};
}

inline PlanarView planar_output(py::array& array, const char* name) { return planar_view(array, writable(array, name), name); }

inline ChannelOrder channel_order(const std::string& order) {
  if (order == "rgb") return ChannelOrder::rgb;
  if (order == "bgr") return ChannelOrder::bgr;
  if (order == "gray") return ChannelOrder::gray;
  reject("order", "must be rgb, bgr or gray", order);
}

template <size_t Count>
std::array<double, Count> numbers(const Doubles& array, const std::string& name) {
  require(array.size() == static_cast<py::ssize_t>(Count), name, "must hold " + std::to_string(Count) + " numbers",
          array.size());
  std::array<double, Count> result;
  std::copy_n(array.data(), Count, result.begin());
  return result;
}

// Values and covariance of the five terms, vertical disparity and its standard error. None if nothing was measured.
inline py::object pose_tuple(const PoseError& pose) {
  if (!pose.measured) return py::none();
  return py::make_tuple(pose.value, pose.covariance, pose.vertical_px, pose.vertical_se_px);
}

}  // namespace endosdk
