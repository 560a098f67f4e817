#include "geometry/rig_content.hpp"

#include "geometry/rig_rules.hpp"
#include "platform/json.hpp"

namespace endosdk {
namespace {

std::string list(const double* values, int count) {
  std::string text;
  // Adding 0.0 turns -0 into 0, so that equal rigs have the same hash.
  for (int i = 0; i < count; ++i) text.append(i == 0 ? "[" : ",").append(json_number(values[i] + 0.0));
  return text.empty() ? "[]" : text.append("]");
}

std::string matrix(const double* values) {
  std::string text = "[";
  for (int row = 0; row < 3; ++row) text.append(row == 0 ? "" : ",").append(list(values + 3 * row, 3));
  return text.append("]");
}

std::string camera(const double* k, const double* distortion, int count, const double* field_of_view) {
  JsonObject content;
  content.raw("distortion", list(distortion, count));
  if (states_field(field_of_view)) content.raw("field_of_view", list(field_of_view, 4));
  return content.raw("matrix", matrix(k)).done();
}

}  // namespace

std::string rig_content(const endo_calibration& rig) {
  // The keys are in alphabetical order.
  return JsonObject()
      .raw("height", std::to_string(rig.height))
      .raw("left", camera(rig.left_matrix, rig.left_distortion, rig.left_distortion_count, rig.left_field_of_view))
      .text("model", rig.camera_model == ENDO_FISHEYE ? "fisheye" : "pinhole")
      .raw("right", camera(rig.right_matrix, rig.right_distortion, rig.right_distortion_count, rig.right_field_of_view))
      .raw("rotation", matrix(rig.rotation))
      .raw("translation", list(rig.translation, 3))
      .text("units", "mm")
      .raw("width", std::to_string(rig.width))
      .done();
}

}  // namespace endosdk
