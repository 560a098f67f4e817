// ONNX Runtime has no code of its own for memory or threads that are used up; its text tells.
#pragma once

#include <string_view>

namespace endosdk {

// Whether the text of an error of the runtime means ENDO_OUT_OF_MEMORY.
inline bool is_out_of_resources(std::string_view message) {
  for (const char* sign : {"std::bad_alloc", "Failed to allocate memory", "pthread_create failed"}) {
    if (message.find(sign) != std::string_view::npos) return true;
  }
  return false;
}

}  // namespace endosdk
