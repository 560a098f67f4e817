// The vendor's log function, if there is one.
#pragma once

#include <endosdk/endosdk.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "platform/host_gate.hpp"

namespace endosdk {

inline bool breaks_line(char c) { return static_cast<unsigned char>(c) < ' ' || c == '\x7f'; }

inline void make_one_line(char* text) {
  for (; *text != '\0'; ++text) {
    if (breaks_line(*text)) *text = ' ';
  }
}

struct Log {
  endo_log_function function = nullptr;
  void* context = nullptr;
  int level = ENDO_LOG_WARNING;
  HostGate* gate = nullptr;

  // Names of files and what a model says of itself may hold line breaks, and messages of ONNX Runtime do. Without them nobody
  // can write a line of his own into a device's log.
  void operator()(endo_log_level severity, const char* message) const {
    if (function == nullptr || severity > level) return;
    std::string line;
    if (std::any_of(message, message + std::strlen(message), breaks_line)) {
      line = message;
      make_one_line(line.data());
      message = line.c_str();
    }
    HostGate::pass(gate, [&] { function(context, severity, message); });
  }
};

}  // namespace endosdk
