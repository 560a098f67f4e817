// The structs of endosdk.h: read by the size that their caller knows, checked, and turned into ours.
#pragma once

#include <endosdk/endosdk.h>

#include <string>

#include "frame_path/frame_path.hpp"
#include "library/ort_session.hpp"
#include "maps/maps.hpp"
#include "geometry/rig.hpp"

namespace endosdk {

struct OpenRequest {
  FramePathSettings settings;
  SessionSettings session;
  std::string runtime_library;  // empty: search
  std::string runtime_sha256;   // empty: any
  std::string model_sha256;     // empty: any
  std::string float32_model;    // path; empty: none
  std::string float32_model_sha256;
};

void write_default_options(endo_options* options, size_t struct_size);

// Null options are the defaults.
OpenRequest open_request(const endo_options* options);

Rig read_rig(const endo_calibration& calibration);
void write_geometry(const Rig& rig, endo_geometry& geometry);

// A copy of what the caller and this library know of a result.
endo_result read_result(const endo_result* result);

Size frame_size(int32_t width, int32_t height);
FramePair frame_pair(const endo_image* left, const endo_image* right);

// Fills in the caller's endo_result: with what was found, or so that a failure cannot be mistaken for an answer.
class ResultWriter {
 public:
  void accept(endo_result* result);
  void check_capacity(Size size) const;
  MapsOut maps() const;
  FramePair stamped(FramePair pair) const;
  void write(const FrameReport& report);
  void write_failure();

 private:
  void write_rig(const FrameReport& report);
  void write_identity(const Identity& identity);
  void store();

  endo_result* target_ = nullptr;  // null until it was accepted
  endo_result known_{};
};

}  // namespace endosdk
