// Software, model, rig and machine that computed a result: for the records of a device, and to tell results apart later.
#pragma once

#include <string>

#include "frame_path/session.hpp"
#include "geometry/rig.hpp"

namespace endosdk {

struct Identity {
  std::string endosdk;  // version of this code
  std::string model;
  std::string model_version;
  std::string model_sha256;
  std::string calibration_sha256;  // empty without a calibration
  std::string runtime;             // version of ONNX Runtime
  std::string runtime_sha256;      // of its library's file
  std::string provider;            // provider that computes the network, by the runtime's own name
  std::string device;              // the processor of this machine
};

Identity identity_of(const ModelInfo& model, const SessionFacts& session, const Rig* rig);

}  // namespace endosdk
