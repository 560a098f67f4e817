// The results that an estimator's streams have taken and not given back: no other frame may write into their memory.
#pragma once

#include <endosdk/endosdk.h>

#include <mutex>
#include <vector>

#include "maps/maps.hpp"

namespace endosdk {

class ResultsInFlight {
 public:
  // For so many more results, so that frames take no memory.
  void make_room(size_t more);

  // Refuses a result that is in flight itself, or has maps in the memory of one that is.
  void check(const endo_result* result, const MapsOut& maps, uint64_t pixels);
  bool holds(const endo_result* result);
  void drop_maps_in_them(MapsOut& maps, uint64_t pixels);

  // The same check, and it is in flight from now on.
  void add(const endo_result* result, const MapsOut& maps, uint64_t pixels);
  void remove(const endo_result* result);

 private:
  struct Taken {
    const endo_result* result;
    MapsOut maps;
    uint64_t pixels;
  };

  void check_locked(const endo_result* result, const MapsOut& maps, uint64_t pixels) const;

  std::mutex mutex_;
  std::vector<Taken> taken_;
};

}  // namespace endosdk
