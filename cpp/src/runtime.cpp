#include "runtime.hpp"

#include <dlfcn.h>
#include <glob.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <new>
#include <vector>

namespace endosdk {
namespace {

constexpr const char* telemetry_switch = "ORT_DISABLE_TELEMETRY";
constexpr const char* rule = "ONNX Runtime 1.21 or later must be installed, or named by options.runtime_library or "
                             "ENDOSDK_ORT_LIBRARY";

// The runtime's thread pools live as long as the process, so its code must, too: it is never unmapped.
constexpr int open_mode = RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE;

void add_matches(const std::string& pattern, std::vector<std::string>& paths) {
  glob_t found{};
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    paths.insert(paths.end(), found.gl_pathv, found.gl_pathv + found.gl_pathc);
  }
  globfree(&found);
}

// Where to look when nobody says.
std::vector<std::string> usual_places() {
  std::vector<std::string> paths;
  Dl_info self{};
  if (dladdr(reinterpret_cast<const void*>(&usual_places), &self) != 0 && self.dli_fname != nullptr) {
    const std::string file = self.dli_fname;
    const size_t slash = file.rfind('/');
    if (slash != std::string::npos) add_matches(file.substr(0, slash) + "/libonnxruntime.so*", paths);
  }
  if (const char* environment = secure_getenv("VIRTUAL_ENV")) {
    add_matches(std::string(environment) + "/lib/python3.*/site-packages/onnxruntime/capi/libonnxruntime.so*", paths);
  }
  paths.emplace_back("libonnxruntime.so.1");
  paths.emplace_back("libonnxruntime.so");
  return paths;
}

std::vector<std::string> places(const std::string& path) {
  if (!path.empty()) return {path};
  const char* chosen = secure_getenv("ENDOSDK_ORT_LIBRARY");
  if (chosen != nullptr && *chosen != '\0') return {chosen};
  return usual_places();
}

bool telemetry_is_off() {
  const char* value = std::getenv(telemetry_switch);
  return value != nullptr && std::strcmp(value, "1") == 0;
}

}  // namespace

std::shared_ptr<const Runtime> Runtime::open(const std::string& path, const Log& log) {
  const bool was_off = telemetry_is_off();
  // The library reads this while it is being opened; later is too late. It is not touched when it is set already.
  if (!was_off && setenv(telemetry_switch, "1", 1) != 0) throw std::bad_alloc();
  std::string tried;
  for (const std::string& place : places(path)) {
    void* before = dlopen(place.c_str(), RTLD_LAZY | RTLD_NOLOAD);
    if (before != nullptr) dlclose(before);
    void* library = dlopen(place.c_str(), open_mode);
    if (library == nullptr) {
      tried += (tried.empty() ? "" : "; ") + std::string(dlerror());
      continue;
    }
    auto runtime = std::make_shared<const Runtime>(library, place, before != nullptr && !was_off);
    if (runtime->telemetry_on()) {
      log(ENDO_LOG_WARNING, "ONNX Runtime was opened by the host with its telemetry on; set ORT_DISABLE_TELEMETRY=1 first");
    }
    log(ENDO_LOG_INFO, ("ONNX Runtime " + runtime->version() + " from " + place).c_str());
    return runtime;
  }
  fail(ENDO_RUNTIME_MISSING, "runtime_library", rule, tried);
}

Runtime::Runtime(void* library, std::string path, bool was_loaded) : library_(library), path_(std::move(path)) {
  using GetBase = const OrtApiBase*(ORT_API_CALL*)();
  const auto get_base = reinterpret_cast<GetBase>(dlsym(library_, "OrtGetApiBase"));
  if (get_base != nullptr) {
    version_ = get_base()->GetVersionString();
    api_ = get_base()->GetApi(runtime_api);
  }
  if (api_ == nullptr) {
    dlclose(library_);
    fail(ENDO_RUNTIME_MISSING, "runtime_library", rule, path_ + (version_.empty() ? ", another library" : ", " + version_));
  }
  // Once on, it stays on, although the switch is set from now on.
  static std::atomic<bool> left_on{false};
  if (was_loaded) left_on = true;
  telemetry_on_ = left_on;
}

Runtime::~Runtime() { dlclose(library_); }

}  // namespace endosdk
