// Any numbers as a rig: they are refused, or the maps that follow from them can be built and used.
#include "target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static endo_estimator* const estimator = open_tiny_model();
  endo_calibration rig = {};
  if (size > sizeof rig) return -1;
  std::memcpy(&rig, data, size);
  if (rig.struct_size > sizeof rig) return -1;  // may only name memory that the struct has
  const bool valid_size = endo_set_calibration(estimator, &rig) == ENDO_OK && int64_t{rig.width} * rig.height <= 96 * 96;
  if (valid_size) {
    endo_geometry geometry = {};
    geometry.struct_size = sizeof geometry;
    must(endo_get_geometry(estimator, &geometry) == ENDO_OK);
    must(geometry.focal_px > 0.0 && geometry.baseline_mm > 0.0);
    Frame frame(rig.width, rig.height);
    frame.predict(estimator);
  }
  return 0;
}
