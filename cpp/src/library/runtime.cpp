#include "library/runtime.hpp"

#include <dlfcn.h>
#include <glob.h>
#include <link.h>
#include <sys/auxv.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <new>
#include <string_view>
#include <vector>

namespace endosdk {
namespace {

constexpr const char* telemetry_switch = "ORT_DISABLE_TELEMETRY";
constexpr const char* rule = "ONNX Runtime 1.21 or later must be installed, or named by options.runtime_library or "
                             "ENDOSDK_ORT_LIBRARY";

void add_matches(const std::string& pattern, std::vector<std::string>& paths) {
  glob_t found{};
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    paths.insert(paths.end(), found.gl_pathv, found.gl_pathv + found.gl_pathc);
  }
  globfree(&found);
}

// The folder of the file that this code came from; empty where that is not known beyond doubt.
std::string own_folder() {
  // Whoever starts a program with raised privileges can link it into a folder of his own and start it there.
  if (getauxval(AT_SECURE) != 0) return {};
  Dl_info self{};
  link_map* object = nullptr;
  const void* here = reinterpret_cast<const void*>(&own_folder);
  if (dladdr1(here, &self, reinterpret_cast<void**>(&object), RTLD_DL_LINKMAP) == 0) return {};
  // The program itself has no name here. What dladdr would say of it is argv[0], which its caller chose.
  std::error_code unknown;
  const std::filesystem::path file =
      *object->l_name == '\0' ? std::filesystem::read_symlink("/proc/self/exe", unknown) : object->l_name;
  return file.is_absolute() ? file.parent_path().string() : std::string();
}

// Where to look when nobody says.
std::vector<std::string> usual_places() {
  std::vector<std::string> paths;
  const std::string beside = own_folder();
  if (!beside.empty()) add_matches(beside + "/libonnxruntime.so*", paths);
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
  const auto pass_on = [&](const std::string& reason) { tried += (tried.empty() ? "" : "; ") + reason; };
  for (const std::string& place : places(path)) {
    void* before = dlopen(place.c_str(), RTLD_LAZY | RTLD_NOLOAD);
    if (before != nullptr) dlclose(before);
    void* library = dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
      pass_on(dlerror());
      continue;
    }
    const std::shared_ptr<const Runtime> runtime(new Runtime(library, place, before != nullptr && !was_off));
    if (runtime->api_ == nullptr) {
      pass_on(place + (runtime->version_.empty() ? ", another library" : ", " + runtime->version_));
      continue;
    }
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
  if (get_base == nullptr) return;
  version_ = get_base()->GetVersionString();
  api_ = get_base()->GetApi(runtime_api);
  if (api_ == nullptr) return;
  // Once on, it stays on, although the switch is set from now on.
  static std::atomic<bool> left_on{false};
  if (was_loaded) left_on = true;
  telemetry_on_ = left_on;
}

// One that was used is never closed: its thread pools live as long as the process, so its code must, too. One that was
// turned down must go, or the loader would take it again for a later place by its name.
Runtime::~Runtime() {
  if (api_ == nullptr) dlclose(library_);
}

bool Runtime::is_out_of_resources(std::string_view message) {
  for (const char* sign : {"std::bad_alloc", "Failed to allocate memory", "pthread_create failed"}) {
    if (message.find(sign) != std::string_view::npos) return true;
  }
  return false;
}

}  // namespace endosdk
