// A rig, in the form in which Python passes it.
#pragma once

#include <algorithm>
#include <string>
#include <tuple>

#include "arrays.hpp"
#include "geometry/rig.hpp"

namespace endosdk {

// Model, width, height, matrix and distortion of the left camera, then of the right one, rotation, translation, field of view
// of the left camera, then of the right one.
using RigNumbers = std::tuple<std::string, int, int, Doubles, Doubles, Doubles, Doubles, Doubles, Doubles, Doubles, Doubles>;

inline endo_calibration calibration_of(const RigNumbers& given) {
  const auto& [model, width, height, left_matrix, left_distortion, right_matrix, right_distortion, rotation, translation,
               left_field, right_field] = given;
  endo_calibration rig{};
  rig.struct_size = sizeof rig;
  rig.camera_model = model == "fisheye" ? ENDO_FISHEYE : ENDO_PINHOLE;
  rig.width = width;
  rig.height = height;
  const auto copy = [](const auto& values, double* to) { std::copy(values.begin(), values.end(), to); };
  copy(numbers<9>(left_matrix, "left_matrix"), rig.left_matrix);
  copy(numbers<9>(right_matrix, "right_matrix"), rig.right_matrix);
  copy(numbers<9>(rotation, "rotation"), rig.rotation);
  copy(numbers<3>(translation, "translation"), rig.translation);
  copy(numbers<4>(left_field, "left_field_of_view"), rig.left_field_of_view);
  copy(numbers<4>(right_field, "right_field_of_view"), rig.right_field_of_view);
  const auto copy_distortion = [](const Doubles& values, const char* name, double* to) {
    require(values.size() <= 8, name, "must hold at most 8 coefficients", values.size());
    std::copy_n(values.data(), values.size(), to);
    return static_cast<int32_t>(values.size());
  };
  rig.left_distortion_count = copy_distortion(left_distortion, "left_distortion", rig.left_distortion);
  rig.right_distortion_count = copy_distortion(right_distortion, "right_distortion", rig.right_distortion);
  return rig;
}

inline Rig rig_of(const RigNumbers& given) { return Rig(calibration_of(given)); }

}  // namespace endosdk
