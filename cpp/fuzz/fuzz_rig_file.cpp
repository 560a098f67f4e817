// Any text as a rig file: it is refused, or an estimator takes the rig and its hash is that of the file.
#include "target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static endo_estimator* const estimator = open_tiny_model();
  endo_calibration rig = {};
  rig.struct_size = sizeof rig;
  const endo_status status = endo_read_calibration(reinterpret_cast<const char*>(data), size, &rig);
  must(status == ENDO_OK || status == ENDO_CALIBRATION_UNREADABLE || status == ENDO_INVALID_CALIBRATION ||
       status == ENDO_INVALID_ARGUMENT);
  if (status == ENDO_OK) must(endo_set_calibration(estimator, &rig) == ENDO_OK);
  return 0;
}
