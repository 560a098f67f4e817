// The structs of endosdk.h: read by the size that their caller knows, checked, and turned into ours.
#pragma once

#include <endosdk/endosdk.h>

#include <memory>

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
  // With those that the stream has in flight, of which this becomes one until it is written; null: of no stream.
  void accept(endo_result* result, std::shared_ptr<ResultsInFlight> in_flight = nullptr);

  // Refuses pictures in whose memory the result has maps.
  void check_apart(const FramePair& pair);
  void check_capacity(Size size) const;
  MapsOut maps() const;
  FramePair stamped(FramePair pair) const;
  void write(const FrameReport& report);
  void write_failure();

 private:
  void write_rig(const FrameReport& report);
  void write_identity(const Identity& identity);
  void give_up(bool alone);
  void store();
  void let_go();

  std::shared_ptr<ResultsInFlight> in_flight_;
  endo_result* target_ = nullptr;  // null while nothing may be written to it
  endo_result known_{};
};

}  // namespace endosdk
