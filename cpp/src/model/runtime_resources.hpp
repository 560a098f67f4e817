// Memory and threads that ONNX Runtime needs. It has no code of its own for either being used up: its text tells. Where
// memory ends while it opens, it can end the process, so what it needs is asked for before.
#pragma once

#include <cstddef>
#include <string_view>

namespace endosdk {

// Whether the text of an error of the runtime means ENDO_OUT_OF_MEMORY.
inline bool is_out_of_resources(std::string_view message) {
  for (const char* sign : {"std::bad_alloc", "Failed to allocate memory", "pthread_create failed"}) {
    if (message.find(sign) != std::string_view::npos) return true;
  }
  return false;
}

// Each throws OUT_OF_MEMORY unless this process may have enough more memory now: to load the runtime's library; to make a
// session of a model file. None of it stays, so another thread can still take it.
void require_memory_for_runtime();
void require_memory_for_session(int threads, size_t model_bytes);

}  // namespace endosdk
