// ONNX Runtime. It is found and opened at run time, so that one binary works with every version from 1.21 on.
#pragma once

#include "library/onnxruntime.hpp"

#include <memory>
#include <string>

#include "model/runtime_resources.hpp"
#include "platform/log.hpp"
#include "platform/errors.hpp"

namespace endosdk {

// The runtime's function table only grows. This version has all functions that are called here.
constexpr uint32_t runtime_api = 21;
static_assert(ORT_API_VERSION >= runtime_api, "the headers of ONNX Runtime must be of version 1.21 or later");

class Runtime {
 public:
  // An empty path searches in this order: $ENDOSDK_ORT_LIBRARY, beside this library, the active Python environment, the system.
  // If `expected` is not empty, it must be the hash of the file at the path. It is checked before any code of the file runs.
  static std::shared_ptr<const Runtime> open(const std::string& path, const std::string& expected, const Log& log);

  ~Runtime();
  Runtime(const Runtime&) = delete;
  Runtime& operator=(const Runtime&) = delete;

  const OrtApi& api() const { return *api_; }
  const std::string& version() const { return version_; }
  const std::string& path() const { return path_; }
  const std::string& sha256() const { return sha256_; }  // of the library's file

  // Whether the host opened the library with its telemetry on, before this code could switch it off.
  bool telemetry_on() const { return telemetry_on_; }

  // Turns a failed call of the runtime into an Error with this code, or ENDO_OUT_OF_MEMORY if memory or threads are missing.
  template <typename Rule>
  void check(OrtStatus* status, endo_status code, const char* argument, const Rule& rule) const {
    if (status == nullptr) return;
    const std::unique_ptr<OrtStatus, void(ORT_API_CALL*)(OrtStatus*)> held(status, api_->ReleaseStatus);
    const char* message = api_->GetErrorMessage(held.get());
    fail(is_out_of_resources(message) ? ENDO_OUT_OF_MEMORY : code, argument, rule, message);
  }

 private:
  Runtime(void* library, std::string path, bool was_loaded);  // without an api_ if the library cannot be used

  void* library_;
  std::string path_;
  std::string version_;
  std::string sha256_;
  const OrtApi* api_ = nullptr;
  bool telemetry_on_ = false;
};

// A string that the runtime allocated.
struct OrtTextRelease {
  OrtAllocator* allocator;
  void operator()(char* text) const { allocator->Free(allocator, text); }
};
using OrtText = std::unique_ptr<char, OrtTextRelease>;

// Objects of the runtime are released by functions from its table.
template <typename Type>
using OrtHandle = std::unique_ptr<Type, void(ORT_API_CALL*)(Type*)>;

}  // namespace endosdk
