// A session that is implemented in Python. The GIL is held only while its methods are called.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>

#include "frame_path/session.hpp"

namespace endosdk {

// The Python object has the attributes `metadata`, `sha256`, `provider`, `provider_options`, `runtime_version`,
// `runtime_library`, `runtime_sha256` and `telemetry_on`. Its method `bind(left, right, disparity, confidence)` gets arrays
// over the memory of the frame path, and returns an object with `run`, `stop` and `resume`. Its methods `for_size(height,
// width)` and `for_one_thread_each()` return another session or None.
class PythonSession : public Session {
 public:
  explicit PythonSession(pybind11::object session);
  ~PythonSession() override;

  const ModelInfo& model() const override { return info_; }
  const SessionFacts& facts() const override { return facts_; }
  std::shared_ptr<Session> for_size(Size input) override;
  std::unique_ptr<Run> bind(SessionBuffers& buffers) override;
  std::shared_ptr<Session> for_one_thread_each() override;

 private:
  class BoundRun;

  pybind11::object session_;
  ModelInfo info_;
  SessionFacts facts_;
};

}  // namespace endosdk
