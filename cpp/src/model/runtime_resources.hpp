// Memory and threads that ONNX Runtime needs. It has no error code for a lack of either; only the text of its error tells. If
// memory runs out while it opens, it can end the process. So its needs are tested before.
#pragma once

#include <cstddef>
#include <string_view>

namespace endosdk {

// Whether the text of a runtime error means ENDO_OUT_OF_MEMORY.
inline bool is_out_of_resources(std::string_view message) {
  for (const char* sign : {"std::bad_alloc", "Failed to allocate memory", "pthread_create failed"}) {
    if (message.find(sign) != std::string_view::npos) return true;
  }
  return false;
}

// All throw ENDO_OUT_OF_MEMORY unless this process can now get enough memory: so many bytes, or enough to load the runtime's
// library or to create a session of a model file. The memory is only tested, not kept, so another thread can still take it.
void require_memory(size_t bytes, const char* argument);
void require_memory_for_runtime();
void require_memory_for_session(int threads, size_t model_bytes);

}  // namespace endosdk
