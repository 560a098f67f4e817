// The vendor's log function, if there is one.
#pragma once

#include <endosdk/endosdk.h>

#include "platform/host_gate.hpp"

namespace endosdk {

// Messages of ONNX Runtime may have several lines.
inline void make_one_line(char* text) {
  for (; *text != '\0'; ++text) {
    if (static_cast<unsigned char>(*text) < ' ') *text = ' ';
  }
}

struct Log {
  endo_log_function function = nullptr;
  void* context = nullptr;
  int level = ENDO_LOG_WARNING;
  HostGate* gate = nullptr;

  void operator()(endo_log_level severity, const char* message) const {
    if (function == nullptr || severity > level) return;
    HostGate::pass(gate, [&] { function(context, severity, message); });
  }
};

}  // namespace endosdk
