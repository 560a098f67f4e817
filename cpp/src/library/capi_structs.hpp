// The structs of endosdk.h: read by the size that their caller knows, checked, and turned into ours.
#pragma once

#include <endosdk/endosdk.h>

#include <array>
#include <memory>
#include <utility>

#include "frame_path/frame_path.hpp"
#include "library/results_in_flight.hpp"
#include "maps/maps.hpp"
#include "geometry/rig.hpp"

namespace endosdk {

Rig read_rig(const endo_calibration& calibration);
void write_rig(endo_calibration numbers, endo_calibration& calibration);
void write_geometry(const Rig& rig, endo_geometry& geometry);

// A copy of what the caller and this library know of a result. Refuses one whose maps nobody may read or write.
endo_result read_result(const endo_result* result);

FramePair frame_pair(const endo_image* left, const endo_image* right);

// Fills in the caller's endo_result: with what was found, or so that a failure cannot be mistaken for an answer.
class ResultWriter {
 public:
  // From here on, a failure is written to it.
  void accept(endo_result* result);

  // Those of the estimator that are in flight: nothing is written into their memory.
  void beside(std::shared_ptr<ResultsInFlight> in_flight) { in_flight_ = std::move(in_flight); }

  // Refuses a result that cannot take the answer for these pictures.
  void check(const FramePair& pair);

  // Makes it one that is in flight, until it is written or let go.
  void join();
  void let_go();

  MapsOut maps() const;
  FramePair stamped(FramePair pair) const;
  void write(const FrameReport& report);

  // Nothing is written to maps that were refused themselves: they may lie in each other, in a picture or in a frame in flight.
  void write_failure();

 private:
  void write_rig(const FrameReport& report);
  void write_identity(const Identity& identity);
  void store();
  MapsOut writable_maps() const;
  uint64_t pixels() const;

  std::shared_ptr<ResultsInFlight> in_flight_;
  bool joined_ = false;
  endo_result* target_ = nullptr;  // null while nothing may be written to it
  endo_result known_{};
  std::array<Memory, 2> pictures_{};  // none until they were read
  uint64_t frame_pixels_ = 0;
};

}  // namespace endosdk
