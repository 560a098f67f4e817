#include "library/guarded.hpp"

#include <cstdio>

#include "platform/log.hpp"

namespace endosdk {
namespace {

// The buffer is fixed, so that a lack of memory can be reported, too.
thread_local char text[1024] = "";

}  // namespace

const char* last_error() { return text; }

endo_status report(endo_status status, const char* message) {
  std::snprintf(text, sizeof text, "%s [%s]", message, endo_status_name(status));
  make_one_line(text);
  return status;
}

}  // namespace endosdk
