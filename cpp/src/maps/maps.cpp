#include "maps/maps.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>

#include "platform/errors.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int pixels_per_block = 16384;

void write_steps(const float* values, const uint8_t* reasons, int begin, int end, float steps, uint16_t* out) {
  for (int i = begin; i < end; ++i) {
    const float value = reasons[i] == 0 ? values[i] * steps + 0.5f : 0.0f;
    // With principal points apart a disparity may be negative; the format has no such numbers.
    out[i] = static_cast<uint16_t>(std::clamp(value, 0.0f, 65535.0f));
  }
}

// Where a map lies.
struct Memory {
  template <typename Value>
  Memory(const char* name_of_map, const Value* data, bool needs_calibration = false)
      : name(name_of_map), begin(reinterpret_cast<uintptr_t>(data)), bytes_per_pixel(sizeof(Value)), metric(needs_calibration) {}

  uintptr_t end(uint64_t pixels) const { return begin + pixels * bytes_per_pixel; }

  const char* name;
  uintptr_t begin;  // 0: not wanted
  uintptr_t bytes_per_pixel;
  bool metric;
};

std::array<Memory, 7> memory_of(const MapsOut& maps) {
  return {Memory("disparity", maps.disparity),         Memory("confidence", maps.confidence),
          Memory("reasons", maps.reasons),             Memory("disparity_u16", maps.disparity_u16),
          Memory("depth", maps.depth, true),           Memory("sigma", maps.sigma, true),
          Memory("depth_u16", maps.depth_u16, true)};
}

}  // namespace

void check_memory(const MapsOut& maps, uint64_t pixels) {
  const auto all = memory_of(maps);
  for (const Memory& map : all) {
    const uintptr_t too_far = map.begin % map.bytes_per_pixel;
    require(too_far == 0, map.name, Text("must be aligned to ", map.bytes_per_pixel, " bytes"), Text(too_far, " too far"));
  }
  for (const Memory& map : all) {
    for (const Memory& other : all) {
      const bool apart = &other == &map || map.begin == 0 || other.begin == 0 || other.end(pixels) <= map.begin ||
                         map.end(pixels) <= other.begin;
      require(apart, map.name, Text("must not lie in the memory of ", other.name), "maps that overlap");
    }
  }
}

void check_maps(const MapsOut& maps, Size size, bool calibrated) {
  for (const Memory& map : memory_of(maps)) {
    const bool wanted = map.begin != 0;
    require(calibrated || !map.metric || !wanted, ENDO_CALIBRATION_REQUIRED, map.name, calibration_rule, "no calibration");
  }
  check_memory(maps, static_cast<uint64_t>(size.width) * static_cast<uint64_t>(size.height));
}

MapsOut SpareMaps::complete(const MapsOut& wanted) {
  MapsOut all = wanted;
  if (all.disparity == nullptr) all.disparity = disparity_.data();
  if (all.confidence == nullptr) all.confidence = confidence_.data();
  if (all.reasons == nullptr) all.reasons = reasons_.data();
  if (all.depth == nullptr && all.depth_u16 != nullptr) all.depth = depth_.data();
  return all;
}

void write_u16(const MapsOut& maps, size_t pixels, double depth_unit_mm) {
  if (maps.disparity_u16 == nullptr && maps.depth_u16 == nullptr) return;
  const float depth_steps = static_cast<float>(1.0 / depth_unit_mm);
  const auto convert = [&](int begin, int end, int) {
    if (maps.disparity_u16 != nullptr) {
      write_steps(maps.disparity, maps.reasons, begin, end, 256.0f, maps.disparity_u16);
    }
    if (maps.depth_u16 != nullptr) write_steps(maps.depth, maps.reasons, begin, end, depth_steps, maps.depth_u16);
  };
  parallel_for(static_cast<int>(pixels), pixels_per_block, convert);
}

void write_no_answer(const MapsOut& maps, size_t pixels) {
  const float nothing = std::numeric_limits<float>::quiet_NaN();
  for (float* map : {maps.disparity, maps.depth, maps.sigma}) {
    if (map != nullptr) std::fill_n(map, pixels, nothing);
  }
  if (maps.confidence != nullptr) std::fill_n(maps.confidence, pixels, 0.0f);
  if (maps.reasons != nullptr) std::memset(maps.reasons, ENDO_REASON_LOW_CONFIDENCE, pixels);
  for (uint16_t* map : {maps.disparity_u16, maps.depth_u16}) {
    if (map != nullptr) std::fill_n(map, pixels, uint16_t{0});
  }
}

}  // namespace endosdk
