// What a host may choose of a frame path, and the rules for it. The defaults are those of both faces.
#pragma once

#include <memory>
#include <optional>

#include "frame_path/limits.hpp"
#include "images/size.hpp"
#include "platform/host_gate.hpp"
#include "platform/log.hpp"
#include "platform/thread_start.hpp"

namespace endosdk {

struct FramePathSettings {
  int threads = 0;              // processor threads per stage; 0: default_thread_count()
  std::optional<Size> network;  // the network's pictures; none: of the model's inference width
  Limits limits;
  double deadline_ms = 0.0;  // a frame that takes longer is late; 0: none is
  double max_age_ms = 0.0;   // a pair that was taken longer ago is stale; 0: none is
  Log log;
  Log frame_log;  // lines about single frames
  ThreadHook thread_hook;
  std::shared_ptr<HostGate> host_gate;  // that of log, frame_log and thread_hook; null: they can be called for ever
};

void check_settings(const FramePathSettings& settings);

}  // namespace endosdk
