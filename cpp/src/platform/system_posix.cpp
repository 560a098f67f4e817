// Linux and macOS.
#include <dlfcn.h>
#include <fcntl.h>
#include <glob.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/utsname.h>
#include <unistd.h>

#ifdef __APPLE__
#include <mach-o/dyld.h>
#include <sys/sysctl.h>
#else
#include <link.h>
#include <sys/auxv.h>
#endif

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>

#include "platform/system.hpp"

namespace endosdk::system {
namespace {

#ifdef __APPLE__
constexpr const char* runtime_pattern = "/libonnxruntime*.dylib";
constexpr const char* runtime_names[] = {"libonnxruntime.dylib"};
constexpr const char* crypto_names[] = {"libcrypto.3.dylib", "libcrypto.1.1.dylib"};
#else
constexpr const char* runtime_pattern = "/libonnxruntime.so*";
constexpr const char* runtime_names[] = {"libonnxruntime.so.1", "libonnxruntime.so"};
constexpr const char* crypto_names[] = {"libcrypto.so.3", "libcrypto.so.1.1"};
#endif

// A folder's name as a pattern for itself.
std::string escaped(const std::string& folder) {
  std::string pattern;
  for (const char letter : folder) {
    if (std::strchr("*?[\\", letter) != nullptr) pattern += '\\';
    pattern += letter;
  }
  return pattern;
}

void add_matches(const std::string& pattern, std::vector<std::string>& paths) {
  glob_t found{};
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    paths.insert(paths.end(), found.gl_pathv, found.gl_pathv + found.gl_pathc);
  }
  globfree(&found);
}

// The loader would wait for ever for somebody who writes to a pipe. Where it looks for a bare name is its own affair.
bool can_be_opened(const std::string& file) {
  struct stat status{};
  return file.find('/') == std::string::npos || stat(file.c_str(), &status) != 0 || S_ISREG(status.st_mode);
}

}  // namespace

void* open_library(const std::string& file, std::string& why) {
  if (!can_be_opened(file)) {
    why = file + ": no regular file";
    return nullptr;
  }
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) why = dlerror();
  return library;
}

void close_library(void* library) { dlclose(library); }

bool is_loaded(const std::string& file) {
  if (!can_be_opened(file)) return false;
  void* library = dlopen(file.c_str(), RTLD_LAZY | RTLD_NOLOAD);
  if (library != nullptr) dlclose(library);
  return library != nullptr;
}

void* symbol(void* library, const char* name) { return dlsym(library, name); }

std::string file_of(const void* address) {
  Dl_info found{};
#ifdef __APPLE__
  if (dladdr(address, &found) == 0) return {};
  const std::filesystem::path file = found.dli_fname;
#else
  link_map* object = nullptr;
  if (dladdr1(address, &found, reinterpret_cast<void**>(&object), RTLD_DL_LINKMAP) == 0) return {};
  // The program itself has no name here. What dladdr would say of it is argv[0], which its caller chose.
  std::error_code unknown;
  const std::filesystem::path file =
      *object->l_name == '\0' ? std::filesystem::read_symlink("/proc/self/exe", unknown) : object->l_name;
#endif
  return file.is_absolute() ? file.string() : std::string();
}

std::vector<std::string> runtime_places(const std::string& own_folder) {
  std::vector<std::string> paths;
  if (!own_folder.empty()) add_matches(escaped(own_folder) + runtime_pattern, paths);
  if (const auto environment = trusted_environment("VIRTUAL_ENV")) {
    add_matches(escaped(*environment) + "/lib/python3.*/site-packages/onnxruntime/capi" + runtime_pattern, paths);
  }
  paths.insert(paths.end(), std::begin(runtime_names), std::end(runtime_names));
  return paths;
}

std::vector<std::string> crypto_places() {
  std::vector<std::string> names(std::begin(crypto_names), std::end(crypto_names));
  std::stable_partition(names.begin(), names.end(), is_loaded);
  return names;
}

bool has_raised_privileges() {
#ifdef __APPLE__
  return issetugid() != 0;
#else
  return getauxval(AT_SECURE) != 0;
#endif
}

std::optional<std::string> trusted_environment(const char* name) {
  const char* value = has_raised_privileges() ? nullptr : std::getenv(name);
  return value != nullptr ? std::optional<std::string>(value) : std::nullopt;
}

bool set_environment(const char* name, const char* value) { return setenv(name, value, 1) == 0; }

std::optional<std::vector<char>> read_file(const std::string& path, size_t most_bytes, std::string& why) {
  const auto failed = [&](const std::string& reason) {
    why = reason;
    return std::nullopt;
  };
  // Opening a pipe would otherwise wait for somebody who writes to it.
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  const std::unique_ptr<FILE, int (*)(FILE*)> file(descriptor < 0 ? nullptr : fdopen(descriptor, "rb"), std::fclose);
  if (!file) {
    const int error = errno;
    if (descriptor >= 0) close(descriptor);
    return failed(std::strerror(error));
  }
  struct stat status{};
  if (fstat(descriptor, &status) != 0) return failed(std::strerror(errno));
  if (!S_ISREG(status.st_mode)) return failed("no regular file");
  if (static_cast<uintmax_t>(status.st_size) > most_bytes) return failed(too_large(static_cast<uintmax_t>(status.st_size), most_bytes));
  std::vector<char> bytes(static_cast<size_t>(status.st_size));
  if (std::fread(bytes.data(), 1, bytes.size(), file.get()) != bytes.size()) return failed(std::strerror(EIO));
  return bytes;
}

int usable_cores() {
#ifdef __linux__
  cpu_set_t cores;
  CPU_ZERO(&cores);
  if (sched_getaffinity(0, sizeof(cores), &cores) == 0) return CPU_COUNT(&cores);
#endif
  return static_cast<int>(std::thread::hardware_concurrency());
}

bool has_memory(size_t bytes) {
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  return memory != MAP_FAILED && munmap(memory, bytes) == 0;
}

void name_this_thread(const char* name) {
#ifdef __APPLE__
  pthread_setname_np(name);
#else
  pthread_setname_np(pthread_self(), name);
#endif
}

namespace {

sigset_t signals_of_others() {
  sigset_t signals;
  sigfillset(&signals);
  for (const int fault : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGABRT}) sigdelset(&signals, fault);
  return signals;
}

class SignalsBlocked {
 public:
  SignalsBlocked() {
    const sigset_t signals = signals_of_others();
    pthread_sigmask(SIG_BLOCK, &signals, &before_);
  }
  ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_;
};

}  // namespace

void block_signals() {
  const sigset_t signals = signals_of_others();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

void with_signals_blocked(const std::function<void()>& start) {
  const SignalsBlocked blocked;
  start();
}

std::string processor_name() {
#ifdef __APPLE__
  char brand[256] = {};
  size_t size = sizeof brand - 1;
  if (sysctlbyname("machdep.cpu.brand_string", brand, &size, nullptr, 0) == 0) return brand;
#else
  std::ifstream facts("/proc/cpuinfo");
  constexpr std::string_view key = "model name";
  for (std::string line; std::getline(facts, line);) {
    const size_t colon = line.find(": ");
    if (line.compare(0, key.size(), key) == 0 && colon != std::string::npos) return line.substr(colon + 2);
  }
#endif
  utsname names{};
  return uname(&names) == 0 ? names.machine : "unknown";
}

bool has_arm_dot_products() {
#if defined(__aarch64__) && defined(__linux__)
  constexpr unsigned long dot_products = 1ul << 20;  // HWCAP_ASIMDDP, which old headers lack
  return (getauxval(AT_HWCAP) & dot_products) != 0;
#elif defined(__aarch64__) && defined(__APPLE__)
  return true;  // every processor of Apple's that runs macOS
#else
  return false;
#endif
}

long process_id() { return getpid(); }

void on_fork(void (*before)(), void (*in_parent)(), void (*in_child)()) { pthread_atfork(before, in_parent, in_child); }

}  // namespace endosdk::system
