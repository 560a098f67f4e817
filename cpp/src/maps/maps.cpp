#include "maps/maps.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include "maps/reasons.hpp"
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
  uintptr_t end(uint64_t pixels) const { return begin + pixels * bytes_per_pixel; }

  const char* name;
  uintptr_t begin;  // 0: not wanted
  uintptr_t bytes_per_pixel;
};

auto memory_of(const MapsOut& maps) {
  const auto memory = [&](const auto& field) {
    return Memory{field.name, reinterpret_cast<uintptr_t>(maps.*field.memory), sizeof *(maps.*field.memory)};
  };
  return std::apply([&](const auto&... field) { return std::array{memory(field)...}; }, map_fields);
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
  for_each_map([&](const auto& field) {
    const bool wanted = maps.*field.memory != nullptr;
    require(calibrated || !field.metric || !wanted, ENDO_CALIBRATION_REQUIRED, field.name, calibration_rule,
            "no calibration");
  });
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

void withdraw_answer(const MapsOut& maps, size_t pixels) {
  for (float* map : {maps.depth, maps.sigma}) {
    if (map != nullptr) std::fill_n(map, pixels, no_number);
  }
  std::fill_n(maps.confidence, pixels, 0.0f);
  for (size_t i = 0; i < pixels; ++i) maps.reasons[i] |= ENDO_REASON_LOW_CONFIDENCE;
}

void write_no_answer(const MapsOut& maps, size_t pixels) {
  for_each_map([&](const auto& field) {
    if (maps.*field.memory != nullptr) std::fill_n(maps.*field.memory, pixels, field.no_answer);
  });
}

}  // namespace endosdk
