#include "library/results_in_flight.hpp"

#include <algorithm>

#include "platform/errors.hpp"

namespace endosdk {

void ResultsInFlight::add(const endo_result* result, const MapsOut& maps, uint64_t pixels) {
  const std::lock_guard lock(mutex_);
  for (const Taken& other : taken_) {
    require(other.result != result, "result", "must not be in flight", "one that was submitted and not received");
    for (Memory memory : memory_of(other.maps, other.pixels)) {
      memory.name = "a frame in flight";
      check_apart(maps, pixels, memory);
    }
  }
  taken_.push_back({result, maps, pixels});
}

void ResultsInFlight::remove(const endo_result* result) {
  const std::lock_guard lock(mutex_);
  std::erase_if(taken_, [&](const Taken& taken) { return taken.result == result; });
}

}  // namespace endosdk
