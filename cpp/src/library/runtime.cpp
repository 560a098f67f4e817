#include "library/runtime.hpp"

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <new>
#include <vector>

#include "platform/lists.hpp"
#include "platform/sha256.hpp"
#include "platform/system.hpp"

namespace endosdk {
namespace {

constexpr const char* telemetry_switch = "ORT_DISABLE_TELEMETRY";
constexpr const char* rule = "ONNX Runtime 1.21 or later must be installed, or named by options.runtime_library or "
                             "ENDOSDK_ORT_LIBRARY";

// The folder of the file that contains this code.
std::string own_folder() {
  // A user can link a program with raised privileges into his own folder and start it there, so the folder cannot be trusted.
  if (system::has_raised_privileges()) return {};
  const std::filesystem::path file = system::file_of(reinterpret_cast<const void*>(&own_folder));
  return file.parent_path().string();
}

std::vector<std::string> places(const std::string& path) {
  if (!path.empty()) return {path};
  const auto chosen = system::trusted_environment("ENDOSDK_ORT_LIBRARY");
  return chosen && !chosen->empty() ? std::vector{*chosen} : system::runtime_places(own_folder());
}

std::string hash_of(const std::string& file) {
  constexpr size_t most_bytes = size_t{1} << 30;
  std::string why;
  const std::optional<std::vector<char>> bytes = system::read_file(file, most_bytes, why);
  require(bytes.has_value(), ENDO_RUNTIME_MISSING, "runtime_library", "must be a file that can be read", file + ": " + why);
  return sha256(bytes->data(), bytes->size());
}

// Hashes each file only once: an opened library stays in memory, even if the file changes later.
std::string hash_once(const std::string& file) {
  static std::mutex mutex;
  static std::map<std::string, std::string> hashes;
  const std::lock_guard lock(mutex);
  const auto known = hashes.find(file);
  return known != hashes.end() ? known->second : hashes.emplace(file, hash_of(file)).first->second;
}

bool telemetry_is_off() {
  const char* value = std::getenv(telemetry_switch);
  return value != nullptr && std::strcmp(value, "1") == 0;
}

}  // namespace

std::shared_ptr<const Runtime> Runtime::open(const std::string& path, const std::string& expected, const Log& log) {
  require(expected.empty() || !path.empty(), "runtime_sha256",
          "needs runtime_library: the file must be known before it is opened", "none");
  if (!expected.empty()) {
    // The system searches for a bare name in other folders. It could open another file than the hashed one.
    require(std::filesystem::path(path).has_parent_path(), "runtime_library", "must be a path with a folder where runtime_sha256 is given",
            path);
    check_sha256(hash_of(path), expected, ENDO_RUNTIME_HASH_MISMATCH, "runtime", path);
  }
  const bool was_off = telemetry_is_off();
  // The library reads this variable while it is being opened, so it must be set before. If it is already set, it is not
  // changed.
  if (!was_off && !system::set_environment(telemetry_switch, "1")) throw std::bad_alloc();
  std::string tried;
  const auto pass_on = [&](const std::string& reason) { append_item(tried, reason, "; "); };
  for (const std::string& place : places(path)) {
    const bool was_loaded = system::is_loaded(place);
    if (!was_loaded) require_memory_for_runtime();
    std::string why;
    void* library = system::open_library(place, why);
    if (library == nullptr) {
      pass_on(why);
      continue;
    }
    const std::shared_ptr<const Runtime> runtime(new Runtime(library, place, was_loaded && !was_off));
    if (runtime->api_ == nullptr) {
      pass_on(place + (runtime->version_.empty() ? ", another library" : ", " + runtime->version_));
      continue;
    }
    // A library that was opened earlier stays in memory, although another file may have its name now.
    if (!expected.empty()) check_sha256(runtime->sha256(), expected, ENDO_RUNTIME_HASH_MISMATCH, "runtime", place);
    if (runtime->telemetry_on()) {
      log(ENDO_LOG_WARNING, "ONNX Runtime was opened by the host with its telemetry on; set ORT_DISABLE_TELEMETRY=1 first");
    }
    log(ENDO_LOG_INFO, ("ONNX Runtime " + runtime->version() + " from " + place).c_str());
    return runtime;
  }
  fail(ENDO_RUNTIME_MISSING, "runtime_library", rule, tried.empty() ? "nothing" : tried);
}

Runtime::Runtime(void* library, std::string path, bool was_loaded) : library_(library), path_(std::move(path)) {
  using GetBase = const OrtApiBase*(ORT_API_CALL*)();
  const auto get_base = reinterpret_cast<GetBase>(system::symbol(library_, "OrtGetApiBase"));
  if (get_base == nullptr) return;
  version_ = get_base()->GetVersionString();
  api_ = get_base()->GetApi(runtime_api);
  if (api_ == nullptr) return;
  const std::string file = system::file_of(reinterpret_cast<const void*>(get_base));
  sha256_ = hash_once(file.empty() ? path_ : file);
  // Telemetry that was once on stays on, although the switch is set from now on.
  static std::atomic<bool> left_on{false};
  if (was_loaded) left_on = true;
  telemetry_on_ = left_on;
}

// A used runtime is never closed: its thread pools live as long as the process, so its code must, too. A rejected library must
// be closed. Otherwise the loader would return it again for a later place with the same name.
Runtime::~Runtime() {
  if (api_ == nullptr) system::close_library(library_);
}

}  // namespace endosdk
