// Any bytes as a model: opening must end in a status, and a model that opens must not break a frame.
#include "target.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  endo_estimator* estimator = nullptr;
  const endo_options options = fuzz_options();
  if (endo_open_memory(data, size, &options, &estimator) == ENDO_OK) {
    Frame frame(64, 48);
    frame.predict(estimator);
  }
  endo_close(estimator);
  return 0;
}
