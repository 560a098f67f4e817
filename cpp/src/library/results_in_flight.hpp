// The results that an estimator's streams have taken and not given back: no other frame may write into their memory.
#pragma once

#include <endosdk/endosdk.h>

#include <mutex>
#include <vector>

#include "maps/maps.hpp"

namespace endosdk {

class ResultsInFlight {
 public:
  // For the results of one more stream, so that frames take no memory; and their room given back when the stream is closed.
  void make_room(size_t more);
  void give_back(size_t room);

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
  size_t promised_ = 0;  // places of all streams
};

}  // namespace endosdk
