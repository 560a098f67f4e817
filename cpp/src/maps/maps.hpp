// The maps of one frame, in the caller's memory or in our own.
#pragma once

#include <endosdk/endosdk.h>

#include <array>
#include <cstdint>
#include <limits>
#include <tuple>
#include <vector>

#include "images/size.hpp"

namespace endosdk {

// What a metric output without a calibration is refused with, in both faces.
constexpr const char* calibration_rule = "needs a calibration (Python: calibration=rig; C: endo_set_calibration)";

// Where one frame's maps go; each pointer may be null where the caller does not want that map.
struct MapsOut {
  float* disparity = nullptr;
  float* confidence = nullptr;
  float* depth = nullptr;
  float* sigma = nullptr;
  uint8_t* reasons = nullptr;
  uint16_t* disparity_u16 = nullptr;
  uint16_t* depth_u16 = nullptr;
};

// Of disparity_u16, per px.
constexpr float disparity_steps = 256.0f;

// What is known of one map, whoever writes or reads it.
template <typename Type>
struct MapField {
  using Value = Type;
  const char* name;
  Type* MapsOut::*memory;
  Type no_answer;  // of a pixel that has none
  bool metric;     // needs a calibration
};

constexpr float no_number = std::numeric_limits<float>::quiet_NaN();

// Every map, once. Python's Maps holds the first of them, in this order.
constexpr std::tuple map_fields = {
    MapField<float>{"disparity", &MapsOut::disparity, no_number, false},
    MapField<float>{"confidence", &MapsOut::confidence, 0.0f, false},
    MapField<uint8_t>{"reasons", &MapsOut::reasons, ENDO_REASON_LOW_CONFIDENCE, false},
    MapField<float>{"depth", &MapsOut::depth, no_number, true},
    MapField<float>{"sigma", &MapsOut::sigma, no_number, true},
    MapField<uint16_t>{"disparity_u16", &MapsOut::disparity_u16, 0, false},
    MapField<uint16_t>{"depth_u16", &MapsOut::depth_u16, 0, true},
};

// Calls visit(field) for each of them.
template <typename Visit>
void for_each_map(Visit visit) {
  std::apply([&](const auto&... field) { (visit(field), ...); }, map_fields);
}

// A stretch of the caller's memory: a map or a picture.
struct Memory {
  const char* name = nullptr;
  uintptr_t begin = 0;
  uintptr_t end = 0;  // no more than begin: there is none
};

// Of every map, in the order of map_fields.
std::array<Memory, std::tuple_size_v<decltype(map_fields)>> memory_of(const MapsOut& maps, uint64_t pixels);

// Refuses maps that lie in this memory.
void check_apart(const MapsOut& maps, uint64_t pixels, const Memory& other);

// Refuses maps that lie in each other, or askew, in memory: nothing may be written to such.
void check_memory(const MapsOut& maps, uint64_t pixels);

// Refuses a map that lies in the memory of another one.
void require_apart(const Memory& map, const Memory& other);

// Leaves out what check_apart or check_memory refuses: a failure is written to the other maps alone.
void drop_maps_in(MapsOut& maps, uint64_t pixels, const Memory& other);
void drop_refused_maps(MapsOut& maps, uint64_t pixels);

// As check_memory, and refuses metric maps without a calibration.
void check_maps(const MapsOut& maps, Size size, bool calibrated);

// Memory for what must be computed although the caller does not want it. Made once per frame size.
class SpareMaps {
 public:
  explicit SpareMaps(size_t pixels) : disparity_(pixels), confidence_(pixels), depth_(pixels), reasons_(pixels) {}

  // The caller's maps, and ours where there is none but one is needed.
  MapsOut complete(const MapsOut& wanted);

 private:
  std::vector<float> disparity_;
  std::vector<float> confidence_;
  std::vector<float> depth_;
  std::vector<uint8_t> reasons_;
};

// Writes the 16-bit maps from the others: disparity in steps of 1/256 px, depth in steps of depth_unit_mm. 0 where there is no
// answer, and where 16 bits cannot hold it.
void write_u16(const MapsOut& maps, size_t pixels, double depth_unit_mm);

// Takes back what was found for a frame that must not be used: no pixel is valid, and the reasons that were found stay.
void withdraw_answer(const MapsOut& maps, size_t pixels);

// Makes every pixel read as one without an answer, so that a failed frame cannot be taken for the one before.
void write_no_answer(const MapsOut& maps, size_t pixels);

}  // namespace endosdk
