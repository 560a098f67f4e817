// The vendor's log function, if there is one.
#pragma once

#include <endosdk/endosdk.h>

namespace endosdk {

struct Log {
  endo_log_function function = nullptr;
  void* context = nullptr;
  int level = ENDO_LOG_WARNING;

  void operator()(endo_log_level severity, const char* message) const {
    if (function != nullptr && severity <= level) function(context, severity, message);
  }
};

}  // namespace endosdk
