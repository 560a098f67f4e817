// The operating system behind one face. What Linux, macOS and Windows do differently stands in system_posix.cpp and
// system_windows.cpp, and nowhere else.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace endosdk::system {

// ---- Shared libraries ----

// Null where the file cannot be opened, or the path leads to something else than a regular file; `why` then says so.
void* open_library(const std::string& file, std::string& why);
void close_library(void* library);
bool is_loaded(const std::string& file);
void* symbol(void* library, const char* name);

// Path of the file that what lies at this address came from; empty where that is not known beyond doubt.
std::string file_of(const void* address);

// Where ONNX Runtime may be, best first, when nobody says: beside our own file, in the active Python environment, where
// the system looks.
std::vector<std::string> runtime_places(const std::string& own_folder);

// Names of OpenSSL's libcrypto, which the system's loader looks for; one that this process uses already comes first.
std::vector<std::string> crypto_places();

// ---- Environment ----

// Whether this process may do what the user who started it may not.
bool has_raised_privileges();

// None, too, for a process with raised privileges: its caller chose the value.
std::optional<std::string> trusted_environment(const char* name);

// Whether it could be set.
bool set_environment(const char* name, const char* value);

// ---- Files ----

// The bytes of a regular file. None where there is none, it is larger or it cannot be read; `why` then says so. Never waits for
// a pipe.
std::optional<std::vector<char>> read_file(const std::string& path, size_t most_bytes, std::string& why);

inline std::string too_large(uintmax_t bytes, size_t most_bytes) {
  return std::to_string(bytes) + " bytes, more than " + std::to_string(most_bytes);
}

// ---- Processor, memory and threads ----

// Cores that this process may use.
int usable_cores();

// Of the maker, such as "Intel(R) Xeon(R) Processor @ 2.90GHz"; the architecture where the system does not tell.
std::string processor_name();

// Whether a processor of the ARM family has dot products of 8-bit integers.
bool has_arm_dot_products();

// What debuggers and `top` show of the calling thread; at most 15 bytes.
void name_this_thread(const char* name);

// Leaves signals that are sent to the process to its other threads. Those of faults stay. Where there are signals.
void block_signals();

// Calls `start` with these signals blocked, as the threads that it starts find them, and then puts back what was.
void with_signals_blocked(const std::function<void()>& start);

// Whether the system gives this process so many more bytes of memory now. None of them stays.
bool has_memory(size_t bytes);

long process_id();

// Called around every fork of this process, where there is such a thing.
void on_fork(void (*before)(), void (*in_parent)(), void (*in_child)());

}  // namespace endosdk::system
