#include "model/runtime_resources.hpp"

#include "platform/errors.hpp"
#include "platform/system.hpp"

namespace endosdk {
namespace {

constexpr size_t megabyte = size_t{1} << 20;
// Loading version 1.32 needs 35 MB, and reading it for its hash needs as much again. Our models then need up to 10 MB, and each
// further thread 6 MB.
constexpr size_t library_bytes = 96 * megabyte;
constexpr size_t session_bytes = 24 * megabyte;
constexpr size_t thread_bytes = 8 * megabyte;
constexpr size_t bytes_per_byte_of_model = 8;

}  // namespace

void require_memory(size_t bytes, const char* argument) {
  if (system::has_memory(bytes)) return;
  fail(ENDO_OUT_OF_MEMORY, argument, Text("needs ", bytes / megabyte, " MB of memory"), "less");
}

void require_memory_for_runtime() { require_memory(library_bytes, "runtime"); }

void require_memory_for_session(int threads, size_t model_bytes) {
  require_memory(session_bytes + static_cast<size_t>(threads) * thread_bytes + bytes_per_byte_of_model * model_bytes, "session");
}

}  // namespace endosdk
