// The results that a stream has taken and not given back: no other frame may write into their memory.
#pragma once

#include <endosdk/endosdk.h>

#include <mutex>
#include <vector>

#include "maps/maps.hpp"

namespace endosdk {

class ResultsInFlight {
 public:
  // With room for as many as usual; more are callers that wait for each other.
  explicit ResultsInFlight(size_t usual) { taken_.reserve(usual); }

  // Refuses a result that is in flight itself, or has maps in the memory of one that is.
  void add(const endo_result* result, const MapsOut& maps, uint64_t pixels);
  void remove(const endo_result* result);

 private:
  struct Taken {
    const endo_result* result;
    MapsOut maps;
    uint64_t pixels;
  };

  std::mutex mutex_;
  std::vector<Taken> taken_;
};

}  // namespace endosdk
