#include "library/results_in_flight.hpp"

#include <algorithm>

#include "platform/errors.hpp"

namespace endosdk {

void ResultsInFlight::make_room(size_t more) {
  const std::lock_guard lock(mutex_);
  promised_ += more;
  taken_.reserve(promised_);
}

void ResultsInFlight::give_back(size_t room) {
  const std::lock_guard lock(mutex_);
  promised_ -= room;
}

void ResultsInFlight::check_locked(const endo_result* result, const MapsOut& maps, uint64_t pixels) const {
  for (const Taken& other : taken_) {
    require(other.result != result, "result", "must not be in flight", "one that was submitted and not received");
    for (Memory memory : memory_of(other.maps, other.pixels)) {
      memory.name = "a frame in flight";
      check_apart(maps, pixels, memory);
    }
  }
}

void ResultsInFlight::check(const endo_result* result, const MapsOut& maps, uint64_t pixels) {
  const std::lock_guard lock(mutex_);
  check_locked(result, maps, pixels);
}

bool ResultsInFlight::holds(const endo_result* result) {
  const std::lock_guard lock(mutex_);
  return std::any_of(taken_.begin(), taken_.end(), [&](const Taken& taken) { return taken.result == result; });
}

void ResultsInFlight::drop_maps_in_them(MapsOut& maps, uint64_t pixels) {
  const std::lock_guard lock(mutex_);
  for (const Taken& taken : taken_) {
    for (const Memory& memory : memory_of(taken.maps, taken.pixels)) drop_maps_in(maps, pixels, memory);
  }
}

void ResultsInFlight::add(const endo_result* result, const MapsOut& maps, uint64_t pixels) {
  const std::lock_guard lock(mutex_);
  check_locked(result, maps, pixels);
  taken_.push_back({result, maps, pixels});
}

void ResultsInFlight::remove(const endo_result* result) {
  const std::lock_guard lock(mutex_);
  std::erase_if(taken_, [&](const Taken& taken) { return taken.result == result; });
}

}  // namespace endosdk
