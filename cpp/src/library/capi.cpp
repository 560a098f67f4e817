// The functions of endosdk.h for estimators. Each converts C structs and turns every exception into a status. Nothing else
// happens here.
#include <endosdk/endosdk.h>

#include <cstring>
#include <memory>
#include <new>
#include <string>

#include "geometry/rig_file.hpp"
#include "library/build_info.hpp"
#include "library/capi_structs.hpp"
#include "library/guarded.hpp"
#include "library/handles.hpp"
#include "library/open_request.hpp"
#include "model/providers.hpp"

using endosdk::Call;
using endosdk::FramePath;
using endosdk::guarded;
using endosdk::OpenedWith;
using endosdk::require_pointer;
using endosdk::with;

namespace {

// One line for the log of a device: what computes from now on.
void log_identity(const FramePath& path) {
  const endosdk::Log& log = path.settings().log;
  if (log.function == nullptr || log.level < ENDO_LOG_INFO) return;
  const std::shared_ptr<const endosdk::Identity> now = path.identity();
  const auto hash = [](const std::string& sha256) { return sha256.empty() ? std::string("none") : "sha256 " + sha256; };
  const std::string line = "endosdk " + now->endosdk + " (" + endosdk::commit_text() + "), model " + now->model + " " +
                           now->model_version + " (" + hash(now->model_sha256) + "), calibration (" +
                           hash(now->calibration_sha256) + "), ONNX Runtime " + now->runtime + " (" +
                           hash(now->runtime_sha256) + "), " + now->provider;
  log(ENDO_LOG_INFO, line.c_str());
}

template <typename ReadModel>
endo_status open(const endo_options* options, endo_estimator** estimator, const ReadModel& read) {
  return guarded([&] {
    require_pointer(estimator, "estimator");
    *estimator = nullptr;
    const endosdk::OpenRequest request = endosdk::open_request(options);
    const bool other = !request.float32_model.empty() && endosdk::wants_float32_model(request.session.provider);
    const endosdk::ModelProof& proof = other ? request.float32_model_proof : request.model_proof;
    if (other) request.settings.log(ENDO_LOG_WARNING, "there is no fast 8-bit arithmetic here: float32_model is used");
    auto model = std::make_shared<const endosdk::ModelFile>(
        other ? endosdk::read_model(request.float32_model, proof) : read(proof));
    const endosdk::Log& log = request.settings.log;
    if (!model->is_sealed && !proof.is_given()) {
      log(ENDO_LOG_WARNING, (model->origin + " carries no seal: damage to its weights would not be noticed; export it "
                             "with this release").c_str());
    }
    auto session = std::make_shared<endosdk::OrtStereoSession>(endosdk::Runtime::open(request.runtime_library, request.runtime_sha256, log),
                                                               std::move(model), request.session, log);
    auto path = std::make_shared<FramePath>(std::move(session), request.settings);
    log_identity(*path);
    const OpenedWith with = {request.session.spinning, !proof.sha256.empty(), proof.signature != nullptr,
                             !request.runtime_sha256.empty(), log.level};
    *estimator = new endo_estimator{std::move(path), with, std::make_shared<endosdk::ResultsInFlight>()};
  });
}

}  // namespace

extern "C" {

const char* endo_version(void) { return endosdk::version_text(); }

const char* endo_build_info(void) { return endosdk::build_info(); }

const char* endo_last_error(void) { return endosdk::last_error(); }

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
    case ENDO_DEPENDENCY_MISSING: return "DEPENDENCY_MISSING";
    case ENDO_CANCELLED: return "CANCELLED";
    case ENDO_OUT_OF_MEMORY: return "OUT_OF_MEMORY";
    case ENDO_SELF_TEST_FAILED: return "SELF_TEST_FAILED";
    case ENDO_INTERNAL: return "INTERNAL";
    case ENDO_CALIBRATION_UNREADABLE: return "CALIBRATION_UNREADABLE";
    case ENDO_RUNTIME_HASH_MISMATCH: return "RUNTIME_HASH_MISMATCH";
  }
  return "UNKNOWN";
}

const char* endo_cause_name(int32_t cause) {
  const endosdk::CauseFact* fact = endosdk::fact_of(cause);
  return fact != nullptr ? fact->name : "UNKNOWN";
}

endo_status endo_options_init(endo_options* options, size_t struct_size) {
  return guarded([&] {
    require_pointer(options, "options");
    endosdk::write_default_options(options, struct_size);
  });
}

endo_status endo_open_file(const char* path, const endo_options* options, endo_estimator** estimator) {
  return open(options, estimator, [&](const endosdk::ModelProof& proof) {
    require_pointer(path, "path");
    return endosdk::read_model(path, proof);
  });
}

endo_status endo_open_memory(const void* data, size_t size, const endo_options* options, endo_estimator** estimator) {
  return open(options, estimator, [&](const endosdk::ModelProof& proof) {
    require_pointer(data, "data");
    return endosdk::copy_model(data, size, proof);
  });
}

void endo_close(endo_estimator* estimator) {
  // A forked child leaves what is its parent's alone: the runtime would wait for threads that it does not have.
  if (estimator == nullptr || !estimator->process.is_this()) return;
  estimator->path->close();
  estimator->callers.wait_for_none();
  // Streams may live on, but what the host's functions need may not.
  estimator->path->settings().host_gate->close();
  delete estimator;
}

endo_status endo_set_calibration(endo_estimator* estimator, const endo_calibration* calibration) {
  return guarded([&] {
    with(estimator, [&](FramePath& path) {
      path.set_calibration(calibration != nullptr ? std::optional(endosdk::read_rig(*calibration)) : std::nullopt);
      try {
        log_identity(path);
      } catch (const std::bad_alloc&) {
        // The line is lost; the calibration is set.
      }
    });
  });
}

endo_status endo_read_calibration(const char* text, size_t size, endo_calibration* calibration) {
  return guarded([&] {
    require_pointer(text, "text");
    require_pointer(calibration, "calibration");
    endosdk::write_rig(endosdk::read_rig_file({text, size}), *calibration);
  });
}

endo_status endo_get_geometry(endo_estimator* estimator, endo_geometry* geometry) {
  return guarded([&] {
    with(estimator, [&](FramePath& path) {
      require_pointer(geometry, "geometry");
      const std::shared_ptr<const endosdk::Rig> rig = path.calibration();
      endosdk::require(rig != nullptr, ENDO_CALIBRATION_REQUIRED, "geometry", endosdk::calibration_rule, "no calibration");
      endosdk::write_geometry(*rig, *geometry);
    });
  });
}

endo_status endo_prepare(endo_estimator* estimator, int32_t width, int32_t height) {
  return guarded([&] {
    with(estimator, [&](FramePath& path) { path.prepare({width, height}); });
  });
}

endo_status endo_predict(endo_estimator* estimator, const endo_image* left, const endo_image* right,
                         endo_result* result) {
  endosdk::ResultWriter writer;
  const endo_status status = guarded([&] {
    writer.accept(result);
    const Call call(estimator, "estimator");
    writer.beside(estimator->in_flight);
    const endosdk::FramePair pair = writer.stamped(endosdk::frame_pair(left, right));
    writer.check(pair);
    writer.write(estimator->path->predict(pair, writer.maps()));
  });
  if (status != ENDO_OK) writer.write_failure();
  return status;
}

endo_status endo_rectify(endo_estimator* estimator, const endo_image* left, const endo_image* right,
                         uint8_t* rectified_left, uint8_t* rectified_right, size_t capacity) {
  return guarded([&] {
    with(estimator, [&](FramePath& path) {
      path.rectify(endosdk::frame_pair(left, right), rectified_left, rectified_right, capacity);
    });
  });
}

endo_status endo_get_rectified(endo_estimator* estimator, uint8_t* left, uint8_t* right, size_t capacity) {
  return guarded([&] {
    with(estimator, [&](FramePath& path) { path.rectified(left, right, capacity); });
  });
}

endo_status endo_cancel(endo_estimator* estimator) {
  return guarded([&] {
    with(estimator, [](FramePath& path) { path.cancel(); });
  });
}

endo_status endo_self_test(endo_estimator* estimator) {
  return guarded([&] {
    with(estimator, [](FramePath& path) { path.self_test(); });
  });
}

endo_status endo_get_diagnostics(endo_estimator* estimator, char* buffer, size_t size, size_t* needed) {
  return guarded([&] {
    if (buffer != nullptr && size > 0) buffer[0] = '\0';
    std::string report;
    with(estimator, [&](FramePath& path) {
      const OpenedWith& asked = estimator->with;
      report = path.diagnostics().flag("spinning", asked.spinning).flag("model_pinned", asked.model_pinned)
                   .flag("model_signed", asked.model_signed).flag("runtime_pinned", asked.runtime_pinned)
                   .count("log_level", static_cast<uint64_t>(asked.log_level)).text("endosdk", endosdk::version_text())
                   .raw("build", endosdk::build_info()).done();
    });
    if (needed != nullptr) *needed = report.size() + 1;
    if (buffer == nullptr) return;
    endosdk::require(size > report.size(), "size", "must be at least " + std::to_string(report.size() + 1) + " bytes", size);
    std::memcpy(buffer, report.c_str(), report.size() + 1);
  });
}

}  // extern "C"
