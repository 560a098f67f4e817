// The runtime's log: its lines go to the host; those on where operations are placed are read while a session is made.
#pragma once

#include "library/onnxruntime.hpp"

#include <atomic>

#include "model/placement.hpp"
#include "platform/log.hpp"

namespace endosdk {

class LogReader {
 public:
  explicit LogReader(const Log& log) : log_(log) {}

  const Log& log() const { return log_; }

  // What the runtime calls, with a LogReader first.
  static void ORT_API_CALL forward(void* reader, OrtLoggingLevel severity, const char* category, const char* logger,
                                   const char* place, const char* message);

  // The least severe lines that the host wants.
  OrtLoggingLevel severity() const;

  // Lines on placement come at the lowest severity of all. Nothing else may use the session between the two calls.
  void start_reading() { reading_ = true; }
  const Placement& stop_reading();

 private:
  const Log log_;
  std::atomic<bool> reading_{false};
  PlacementLog lines_;
};

}  // namespace endosdk
