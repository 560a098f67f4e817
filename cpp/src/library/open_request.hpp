// The checked content of endo_options, in the library's own types.
#pragma once

#include <endosdk/endosdk.h>

#include <string>

#include "frame_path/settings.hpp"
#include "library/ort_session.hpp"

namespace endosdk {

struct OpenRequest {
  FramePathSettings settings;
  SessionSettings session;
  std::string runtime_library;  // empty: search
  std::string runtime_sha256;   // empty: any
  ModelProof model_proof;
  std::string float32_model;  // path; empty: none
  ModelProof float32_model_proof;
};

void write_default_options(endo_options* options, size_t struct_size);

// Checks the options. Null means the defaults.
OpenRequest open_request(const endo_options* options);

}  // namespace endosdk
