// The functions of endosdk.h. Each turns C structs into ours and every exception into a status; nothing else happens here.
#include <endosdk/endosdk.h>

#include <cstdio>
#include <cstring>
#include <new>
#include <system_error>

#include "build_info.hpp"
#include "capi_structs.hpp"
#include "estimator.hpp"

using endosdk::Error;
using endosdk::Estimator;

struct endo_estimator {
  Estimator estimator;
};

namespace {

// A fixed buffer, because out of memory must be reported, too.
thread_local char last_error[1024] = "";

endo_status report(endo_status status, const char* message) {
  std::snprintf(last_error, sizeof last_error, "%s [%s]", message, endo_status_name(status));
  return status;
}

// Runs the body of a function; no exception leaves it.
template <typename Body>
endo_status guarded(const Body& body) noexcept {
  try {
    body();
    return ENDO_OK;
  } catch (const Error& error) {
    return report(error.status(), error.what());
  } catch (const std::bad_alloc&) {
    return report(ENDO_OUT_OF_MEMORY, "memory: must suffice; got none");
  } catch (const std::length_error&) {
    return report(ENDO_OUT_OF_MEMORY, "memory: must suffice; got a request beyond any memory");
  } catch (const std::system_error& error) {
    // What the C++ library throws where no further thread can be started.
    const bool used_up = error.code() == std::errc::resource_unavailable_try_again;
    return used_up ? report(ENDO_OUT_OF_MEMORY, "threads: the system must have one more; got none")
                   : report(ENDO_INTERNAL, error.what());
  } catch (const std::invalid_argument& error) {
    return report(ENDO_INVALID_ARGUMENT, error.what());
  } catch (const std::exception& error) {
    return report(ENDO_INTERNAL, error.what());
  } catch (...) {
    return report(ENDO_INTERNAL, "internal: an unknown exception");
  }
}

template <typename Pointer>
void require_pointer(Pointer pointer, const char* argument) {
  endosdk::require(pointer != nullptr, ENDO_INVALID_ARGUMENT, argument, "must not be NULL", "NULL");
}

Estimator& use(endo_estimator* estimator) {
  require_pointer(estimator, "estimator");
  return estimator->estimator;
}

template <typename ReadModel>
endo_status open(const endo_options* options, endo_estimator** estimator, const ReadModel& read) {
  return guarded([&] {
    require_pointer(estimator, "estimator");
    *estimator = nullptr;
    const endosdk::OpenRequest request = endosdk::open_request(options);
    *estimator = new endo_estimator{Estimator(read(request.model_sha256), request.settings)};
  });
}

endo_quality quality_of(double valid_share) {
  if (valid_share < 0.05) return ENDO_QUALITY_INVALID;
  return valid_share < 0.5 ? ENDO_QUALITY_DEGRADED : ENDO_QUALITY_OK;
}

}  // namespace

extern "C" {

const char* endo_version(void) { return endosdk::version_text(); }

const char* endo_build_info(void) { return endosdk::build_info(); }

const char* endo_last_error(void) { return last_error; }

const char* endo_status_name(int32_t status) {
  switch (status) {
    case ENDO_OK: return "OK";
    case ENDO_INVALID_ARGUMENT: return "INVALID_ARGUMENT";
    case ENDO_INVALID_CALIBRATION: return "INVALID_CALIBRATION";
    case ENDO_CALIBRATION_REQUIRED: return "CALIBRATION_REQUIRED";
    case ENDO_CALIBRATION_SIZE_MISMATCH: return "CALIBRATION_SIZE_MISMATCH";
    case ENDO_MODEL_NOT_FOUND: return "MODEL_NOT_FOUND";
    case ENDO_MODEL_UNREADABLE: return "MODEL_UNREADABLE";
    case ENDO_MODEL_METADATA: return "MODEL_METADATA";
    case ENDO_MODEL_HASH_MISMATCH: return "MODEL_HASH_MISMATCH";
    case ENDO_RUNTIME_MISSING: return "RUNTIME_MISSING";
    case ENDO_PROVIDER_UNAVAILABLE: return "PROVIDER_UNAVAILABLE";
    case ENDO_INFERENCE_FAILED: return "INFERENCE_FAILED";
    case ENDO_CANCELLED: return "CANCELLED";
    case ENDO_OUT_OF_MEMORY: return "OUT_OF_MEMORY";
    case ENDO_SELF_TEST_FAILED: return "SELF_TEST_FAILED";
    case ENDO_INTERNAL: return "INTERNAL";
  }
  return "UNKNOWN";
}

endo_status endo_options_init(endo_options* options, size_t struct_size) {
  return guarded([&] {
    require_pointer(options, "options");
    endosdk::write_default_options(options, struct_size);
  });
}

endo_status endo_open_file(const char* path, const endo_options* options, endo_estimator** estimator) {
  return open(options, estimator, [&](const std::string& expected) {
    require_pointer(path, "path");
    return endosdk::read_model(path, expected);
  });
}

endo_status endo_open_memory(const void* data, size_t size, const endo_options* options, endo_estimator** estimator) {
  return open(options, estimator, [&](const std::string& expected) {
    require_pointer(data, "data");
    return endosdk::copy_model(data, size, expected);
  });
}

void endo_close(endo_estimator* estimator) { delete estimator; }

endo_status endo_set_calibration(endo_estimator* estimator, const endo_calibration* calibration) {
  return guarded([&] {
    Estimator& target = use(estimator);
    target.set_calibration(calibration != nullptr ? std::optional(endosdk::read_rig(*calibration)) : std::nullopt);
  });
}

endo_status endo_get_geometry(endo_estimator* estimator, endo_geometry* geometry) {
  return guarded([&] {
    const std::optional<endosdk::Rig> rig = use(estimator).calibration();
    require_pointer(geometry, "geometry");
    endosdk::require(rig.has_value(), ENDO_CALIBRATION_REQUIRED, "estimator",
                     "must have a calibration: call endo_set_calibration", "none");
    endosdk::write_geometry(*rig, *geometry);
  });
}

endo_status endo_prepare(endo_estimator* estimator, int32_t width, int32_t height) {
  return guarded([&] { use(estimator).prepare(endosdk::frame_size(width, height)); });
}

endo_status endo_predict(endo_estimator* estimator, const endo_image* left, const endo_image* right,
                         endo_result* result) {
  endosdk::ResultWriter writer;
  const endo_status status = guarded([&] {
    writer.accept(result);
    Estimator& target = use(estimator);
    const endosdk::FramePair pair = endosdk::frame_pair(left, right);
    writer.check_capacity(pair.left.width, pair.left.height);
    const endosdk::FrameReport report = target.predict(pair, writer.maps());
    writer.write(report, quality_of(report.valid_share));
  });
  if (status != ENDO_OK) writer.write_failure();
  return status;
}

endo_status endo_get_rectified(endo_estimator* estimator, uint8_t* left, uint8_t* right, size_t capacity) {
  return guarded([&] { use(estimator).rectified(left, right, capacity); });
}

endo_status endo_cancel(endo_estimator* estimator) {
  return guarded([&] { use(estimator).cancel(); });
}

endo_status endo_self_test(endo_estimator* estimator) {
  return guarded([&] { use(estimator).self_test(); });
}

endo_status endo_get_diagnostics(endo_estimator* estimator, char* buffer, size_t size, size_t* needed) {
  return guarded([&] {
    if (buffer != nullptr && size > 0) buffer[0] = '\0';
    const std::string report = use(estimator).diagnostics();
    if (needed != nullptr) *needed = report.size() + 1;
    if (buffer == nullptr) return;
    endosdk::require(size > report.size(), ENDO_INVALID_ARGUMENT, "size",
                     "must be at least " + std::to_string(report.size() + 1) + " bytes", size);
    std::memcpy(buffer, report.c_str(), report.size() + 1);
  });
}

}  // extern "C"
