// What the tests of the library share: where the runtime and the model are, a picture pair of known disparity, and one
// open estimator with maps.
#pragma once

#include <endosdk/endosdk.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "../check.hpp"

struct Places {
  std::string runtime;  // path of libonnxruntime
  std::string model;    // path of the tiny model
};

inline Places places(int argc, char** argv) {
  CHECK(argc >= 3);
  return {argv[1], argv[2]};
}

// Ends the test unless a call gave this status, and a text that holds the word.
inline void expect(endo_status seen, endo_status wanted, const char* word) {
  if (seen != wanted || std::strstr(endo_last_error(), word) == nullptr) {
    std::fprintf(stderr, "wanted %s and \"%s\", got %s: %s\n", endo_status_name(wanted), word, endo_status_name(seen),
                 endo_last_error());
    std::exit(1);
  }
}

inline std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  CHECK(file.good());
  return {std::istreambuf_iterator<char>(file), {}};
}

// A grainy plane: right[x - disparity] == left[x].
inline std::vector<uint8_t> plane(int width, int height, int shift) {
  std::vector<uint8_t> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      uint32_t h = static_cast<uint32_t>((x + shift) / 3 * 7919 + y / 3 * 104729);
      h = (h ^ h >> 13) * 0x5bd1e995u;
      for (int c = 0; c < 3; ++c) pixels.push_back(static_cast<uint8_t>(40 + (h >> (8 + c) & 127u)));
    }
  }
  return pixels;
}

inline endo_options default_options(const Places& at) {
  endo_options options;
  CHECK(endo_options_init(&options, sizeof options) == ENDO_OK);
  options.runtime_library = at.runtime.c_str();
  options.threads = 1;
  return options;
}

struct Pair {
  int width;
  int height;
  std::vector<uint8_t> left;
  std::vector<uint8_t> right;

  Pair(int w, int h, int disparity) : width(w), height(h), left(plane(w, h, 0)), right(plane(w, h, disparity)) {}

  endo_image left_image() const { return {sizeof(endo_image), ENDO_RGB8, left.data(), width, height, 0}; }
  endo_image right_image() const { return {sizeof(endo_image), ENDO_RGB8, right.data(), width, height, 0}; }
};

struct Output {
  std::vector<float> disparity, confidence, depth, sigma;
  std::vector<uint8_t> reasons;
  std::vector<uint16_t> disparity_u16, depth_u16;
  endo_result result{};

  explicit Output(size_t pixels, bool metric = false)
      : disparity(pixels), confidence(pixels), reasons(pixels), disparity_u16(pixels) {
    if (metric) {
      depth.resize(pixels);
      sigma.resize(pixels);
      depth_u16.resize(pixels);
    }
    result.struct_size = sizeof result;
    result.capacity = pixels;
    result.disparity = disparity.data();
    result.confidence = confidence.data();
    result.reasons = reasons.data();
    result.disparity_u16 = disparity_u16.data();
    if (!metric) return;
    result.depth = depth.data();
    result.sigma = sigma.data();
    result.depth_u16 = depth_u16.data();
  }
};

// A raw, slightly misaligned rig.
inline endo_calibration raw_rig(int width, int height) {
  endo_calibration rig{};
  rig.struct_size = sizeof rig;
  rig.width = width;
  rig.height = height;
  rig.left_distortion_count = rig.right_distortion_count = 5;
  const double left[5] = {-0.21, 0.11, 0.0011, -0.0007, -0.03};
  const double right[5] = {-0.19, 0.09, -0.0005, 0.0009, -0.02};
  std::memcpy(rig.left_distortion, left, sizeof left);
  std::memcpy(rig.right_distortion, right, sizeof right);
  for (double* k : {rig.left_matrix, rig.right_matrix}) {
    k[0] = k[4] = 0.8 * width;
    k[2] = 0.5 * width;
    k[5] = 0.5 * height;
    k[8] = 1.0;
  }
  rig.rotation[0] = rig.rotation[4] = rig.rotation[8] = 1.0;
  rig.translation[0] = -4.6;
  rig.translation[1] = 0.05;
  return rig;
}

inline void remove_distortion(endo_calibration& rig) {
  rig.left_distortion_count = rig.right_distortion_count = 0;
  std::memset(rig.left_distortion, 0, sizeof rig.left_distortion);
  std::memset(rig.right_distortion, 0, sizeof rig.right_distortion);
}

class Opened {
 public:
  Opened(const Places& at, const endo_options& options) {
    CHECK(endo_open_file(at.model.c_str(), &options, &handle_) == ENDO_OK);
  }
  explicit Opened(const Places& at) : Opened(at, default_options(at)) {}
  ~Opened() { endo_close(handle_); }
  Opened(const Opened&) = delete;
  Opened& operator=(const Opened&) = delete;

  endo_status predict(const Pair& pair, Output& out) const {
    const endo_image left = pair.left_image();
    const endo_image right = pair.right_image();
    return endo_predict(handle_, &left, &right, &out.result);
  }

  endo_estimator* get() const { return handle_; }

 private:
  endo_estimator* handle_ = nullptr;
};
