// What the fuzzers share. $ENDOSDK_ORT_LIBRARY and $ENDOSDK_FUZZ_MODEL name the runtime and the tiny model.
#pragma once

#include <endosdk/endosdk.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

inline void must(bool holds) {
  if (holds) return;
  std::fprintf(stderr, "broken promise; last error: %s\n", endo_last_error());
  std::abort();
}

inline endo_options fuzz_options() {
  endo_options options;
  must(endo_options_init(&options, sizeof options) == ENDO_OK);
  options.threads = 1;
  return options;
}

inline endo_estimator* open_tiny_model() {
  const char* model = std::getenv("ENDOSDK_FUZZ_MODEL");
  const endo_options options = fuzz_options();
  endo_estimator* estimator = nullptr;
  must(model != nullptr && endo_open_file(model, &options, &estimator) == ENDO_OK);
  return estimator;
}

inline endo_calibration small_rig(int width, int height) {
  endo_calibration rig = {};
  rig.struct_size = sizeof rig;
  rig.width = width;
  rig.height = height;
  rig.left_distortion_count = 4;
  rig.left_distortion[0] = -0.2;
  for (double* k : {rig.left_matrix, rig.right_matrix}) {
    k[0] = k[4] = 60.0;
    k[2] = 0.5 * width;
    k[5] = 0.5 * height;
    k[8] = 1.0;
  }
  rig.rotation[0] = rig.rotation[4] = rig.rotation[8] = 1.0;
  rig.translation[0] = -4.0;
  return rig;
}

// A frame and its maps in memory of exactly their size, so that a sanitizer sees a step beyond.
class Frame {
 public:
  Frame(int width, int height)
      : width_(width),
        height_(height),
        pixels_(static_cast<size_t>(width) * static_cast<size_t>(height)),
        picture_(3 * pixels_, 90),
        floats_(4, std::vector<float>(pixels_)),
        words_(2, std::vector<uint16_t>(pixels_)),
        reasons_(pixels_) {}

  // Each bit of `maps` asks for one map.
  endo_result result(unsigned maps) {
    endo_result r = {};
    r.struct_size = sizeof r;
    r.capacity = pixels_;
    if (maps & 1) r.disparity = floats_[0].data();
    if (maps & 2) r.confidence = floats_[1].data();
    if (maps & 4) r.depth = floats_[2].data();
    if (maps & 8) r.sigma = floats_[3].data();
    if (maps & 16) r.reasons = reasons_.data();
    if (maps & 32) r.disparity_u16 = words_[0].data();
    if (maps & 64) r.depth_u16 = words_[1].data();
    return r;
  }

  void predict(endo_estimator* estimator) {
    const endo_image image = {sizeof image, ENDO_RGB8, picture_.data(), width_, height_, 0};
    endo_result r = result(1 | 2 | 16 | 32);
    const endo_status status = endo_predict(estimator, &image, &image, &r);
    must(status != ENDO_INTERNAL);
  }

 private:
  int width_;
  int height_;
  size_t pixels_;
  std::vector<uint8_t> picture_;
  std::vector<std::vector<float>> floats_;
  std::vector<std::vector<uint16_t>> words_;
  std::vector<uint8_t> reasons_;
};
