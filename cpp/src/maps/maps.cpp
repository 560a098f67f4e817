#include "maps/maps.hpp"

#include <algorithm>

#include "maps/reasons.hpp"
#include "platform/errors.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int pixels_per_block = 16384;

void write_steps(const float* values, const uint8_t* reasons, int begin, int end, float steps, uint16_t* out) {
  for (int i = begin; i < end; ++i) {
    const float value = reasons[i] == 0 ? values[i] * steps + 0.5f : 0.0f;
    // A value that 16 bits cannot hold would read as another one: a far point as a near one. With principal points apart a
    // disparity may also be negative.
    out[i] = static_cast<uint16_t>(value >= 0.0f && value < 65536.0f ? value : 0.0f);
  }
}

uint64_t common_bytes(const Memory& map, const Memory& other) {
  const uintptr_t begin = std::max(map.begin, other.begin);
  const uintptr_t end = std::min(map.end, other.end);
  return end > begin ? end - begin : 0;
}

template <typename Field>
Memory memory_of_map(const MapsOut& maps, const Field& field, uint64_t pixels) {
  const auto begin = reinterpret_cast<uintptr_t>(maps.*field.memory);
  return {field.name, begin, begin == 0 ? 0 : begin + pixels * sizeof *(maps.*field.memory)};
}

// Bytes that it lies behind the last place where it could begin.
template <typename Field>
uintptr_t askew(const MapsOut& maps, const Field& field) {
  return reinterpret_cast<uintptr_t>(maps.*field.memory) % sizeof *(maps.*field.memory);
}

}  // namespace

void require_apart(const Memory& map, const Memory& other) {
  const uint64_t common = common_bytes(map, other);
  require(common == 0, map.name, Text("must not lie in the memory of ", other.name), Text(common, " bytes that both have"));
}

std::array<Memory, std::tuple_size_v<decltype(map_fields)>> memory_of(const MapsOut& maps, uint64_t pixels) {
  return std::apply([&](const auto&... field) { return std::array{memory_of_map(maps, field, pixels)...}; }, map_fields);
}

void check_apart(const MapsOut& maps, uint64_t pixels, const Memory& other) {
  for (const Memory& map : memory_of(maps, pixels)) require_apart(map, other);
}

void check_memory(const MapsOut& maps, uint64_t pixels) {
  for_each_map([&](const auto& field) {
    require(askew(maps, field) == 0, field.name, Text("must be aligned to ", sizeof *(maps.*field.memory), " bytes"),
            Text(askew(maps, field), " too far"));
  });
  const auto all = memory_of(maps, pixels);
  for (const Memory& map : all) {
    for (const Memory& other : all) {
      if (&other != &map) require_apart(map, other);
    }
  }
}

void drop_maps_in(MapsOut& maps, uint64_t pixels, const Memory& other) {
  for_each_map([&](const auto& field) {
    if (common_bytes(memory_of_map(maps, field, pixels), other) > 0) maps.*field.memory = nullptr;
  });
}

void drop_refused_maps(MapsOut& maps, uint64_t pixels) {
  const auto all = memory_of(maps, pixels);  // of two that lie in each other both are dropped
  size_t index = 0;
  for_each_map([&](const auto& field) {
    const size_t own = index++;
    bool refused = askew(maps, field) != 0;
    for (size_t i = 0; i < all.size(); ++i) refused = refused || (i != own && common_bytes(all[own], all[i]) > 0);
    if (refused) maps.*field.memory = nullptr;
  });
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
  // What a rig that moved adds to sigma is found from the depth.
  if (all.depth == nullptr && (all.depth_u16 != nullptr || all.sigma != nullptr)) all.depth = depth_.data();
  return all;
}

void write_u16(const MapsOut& maps, size_t pixels, double depth_unit_mm) {
  if (maps.disparity_u16 == nullptr && maps.depth_u16 == nullptr) return;
  const float depth_steps = static_cast<float>(1.0 / depth_unit_mm);
  const auto convert = [&](int begin, int end, int) {
    if (maps.disparity_u16 != nullptr) {
      write_steps(maps.disparity, maps.reasons, begin, end, disparity_steps, maps.disparity_u16);
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
