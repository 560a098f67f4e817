// Work for kernels on pseudo-random rows, and their outputs.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "platform/sha256.hpp"

namespace endosdk {

// The output of a kernel. Every NaN is replaced by the same one, because its sign differs between processors and means nothing.
class Output {
 public:
  void add(const std::vector<uint8_t>& values) { content_.append(values.begin(), values.end()); }

  void add(std::vector<float> values) {
    for (float& value : values) value = std::isnan(value) ? std::nanf("") : value;
    content_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
  }

  std::string hash() const { return sha256(content_.data(), content_.size()); }

 private:
  std::string content_;
};

using Works = std::map<std::string, std::function<void(Output&)>>;

// The works for the kernels of the frame path, and for those of the functions of model files.
const Works& frame_works();
const Works& network_works();

// Pseudo-random numbers. They are the same after each start.
struct Draws {
  uint32_t state = 1;

  uint32_t next() { return state = state * 1664525u + 1013904223u; }
};

inline Draws draws;
inline int repeats = 1;  // how often each row is computed

inline float draw_float(float low, float high) {
  return low + (high - low) * static_cast<float>(draws.next() >> 8) * (1.0f / static_cast<float>(1 << 24));
}

inline std::vector<uint8_t> bytes(size_t count) {
  std::vector<uint8_t> values(count);
  for (uint8_t& value : values) value = static_cast<uint8_t>(draws.next() >> 24);
  return values;
}

inline std::vector<float> floats(size_t count, float low, float high) {
  std::vector<float> values(count);
  for (float& value : values) value = draw_float(low, high);
  return values;
}

// Kernels do not read their outputs, so a row may be computed several times.
template <typename Kernel>
void compute(const Kernel& kernel) {
  for (int i = 0; i < repeats; ++i) kernel();
}

}  // namespace endosdk
