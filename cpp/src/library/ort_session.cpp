#include "library/ort_session.hpp"

#include <algorithm>
#include <array>

#include "functions/custom_ops.hpp"
#include "model/waiting.hpp"
#include "platform/lists.hpp"

namespace endosdk {
namespace {

std::vector<std::string> available_providers(const Runtime& runtime) {
  char** names = nullptr;
  int count = 0;
  runtime.check(runtime.api().GetAvailableProviders(&names, &count), ENDO_INTERNAL, "runtime", "must list its providers");
  std::vector<std::string> result(names, names + count);
  runtime.check(runtime.api().ReleaseAvailableProviders(names, count), ENDO_INTERNAL, "runtime", "must free its list");
  return result;
}

std::string installed_provider(const Runtime& runtime, const std::string& wanted) {
  const std::string name = full_provider_name(wanted);
  const std::vector<std::string> available = available_providers(runtime);
  std::string installed;
  for (const std::string& here : available) append_item(installed, here);
  std::string short_names;
  for (const Provider& p : providers) append_item(short_names, p.name);
  require(std::find(available.begin(), available.end(), name) != available.end(), ENDO_PROVIDER_UNAVAILABLE, "provider",
          Text("must be a part of the onnxruntime that is here (installed: ", installed, "; short names: ",
               short_names, ")"),
          name);
  return name;
}

}  // namespace

// A run with one set of buffers, which are bound to the session.
class OrtStereoSession::BoundRun : public Session::Run {
 public:
  BoundRun(const OrtStereoSession& session, SessionBuffers& buffers);

  void operator()() override {
    if (!session_.copies_inputs()) return run();
    // The runtime protects its own runs, but it does not protect the input copies of one frame from the run of another.
    const std::lock_guard lock(session_.running_);
    bind_inputs();
    run();
  }

  void stop() override { check(runtime_.api().RunOptionsSetTerminate(options_.get()), "must stop"); }
  void resume() override { check(runtime_.api().RunOptionsUnsetTerminate(options_.get()), "must go on"); }

 private:
  void check(OrtStatus* status, const char* rule) const { runtime_.check(status, ENDO_INTERNAL, "session", rule); }
  void check_run(OrtStatus* status) const {
    runtime_.check(status, ENDO_INFERENCE_FAILED, "session",
                   Text(session_.info_.name.c_str(), " must run on ", session_.facts_.provider.c_str()));
  }

  void run() const { check_run(runtime_.api().RunWithBinding(session_.session_.get(), options_.get(), binding_.get())); }

  // A provider with its own memory copies the inputs when they are bound, not when it runs.
  void bind_inputs();
  OrtValue* wrap(const OrtMemoryInfo* memory, void* data, size_t bytes, const std::array<int64_t, 4>& shape,
                 ONNXTensorElementDataType type);

  const OrtStereoSession& session_;
  const Runtime& runtime_;
  std::vector<OrtHandle<OrtValue>> values_;
  OrtValue* left_ = nullptr;
  OrtValue* right_ = nullptr;
  OrtHandle<OrtIoBinding> binding_;
  OrtHandle<OrtRunOptions> options_;
};

OrtStereoSession::BoundRun::BoundRun(const OrtStereoSession& session, SessionBuffers& buffers)
    : session_(session),
      runtime_(*session.runtime_),
      binding_(nullptr, runtime_.api().ReleaseIoBinding),
      options_(nullptr, runtime_.api().ReleaseRunOptions) {
  const OrtApi& api = runtime_.api();
  constexpr const char* rule = "must bind its memory";
  OrtRunOptions* options = nullptr;
  check(api.CreateRunOptions(&options), rule);
  options_.reset(options);
  // The errors of a run tell all. A line of log for which memory is missing would end the process.
  check(api.RunOptionsSetRunLogSeverityLevel(options, ORT_LOGGING_LEVEL_FATAL), rule);
  OrtIoBinding* binding = nullptr;
  check(api.CreateIoBinding(session_.session_.get(), &binding), rule);
  binding_.reset(binding);
  OrtMemoryInfo* info = nullptr;
  check(api.CreateCpuMemoryInfo(OrtDeviceAllocator, OrtMemTypeDefault, &info), rule);
  const OrtHandle<OrtMemoryInfo> memory(info, api.ReleaseMemoryInfo);
  values_.reserve(4);
  const auto wrap_picture = [&](const PlanarView& view) {
    const size_t bytes = size_t{3} * static_cast<size_t>(view.width) * static_cast<size_t>(view.height);
    return wrap(info, view.data, bytes, {1, 3, view.height, view.width}, ONNX_TENSOR_ELEMENT_DATA_TYPE_UINT8);
  };
  const auto bind_map = [&](const char* name, const MutableFloatView& map) {
    const size_t bytes = sizeof(float) * static_cast<size_t>(map.width) * static_cast<size_t>(map.height);
    OrtValue* value = wrap(info, map.data, bytes, {1, 1, map.height, map.width}, ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT);
    check(api.BindOutput(binding, name, value), rule);
  };
  left_ = wrap_picture(buffers.left());
  right_ = wrap_picture(buffers.right());
  if (!session_.copies_inputs()) bind_inputs();
  bind_map("disparity", buffers.disparity());
  bind_map("confidence", buffers.confidence());
}

void OrtStereoSession::BoundRun::bind_inputs() {
  const OrtApi& api = runtime_.api();
  check_run(api.BindInput(binding_.get(), "left", left_));
  check_run(api.BindInput(binding_.get(), "right", right_));
  check_run(api.SynchronizeBoundInputs(binding_.get()));
}

OrtValue* OrtStereoSession::BoundRun::wrap(const OrtMemoryInfo* memory, void* data, size_t bytes,
                                           const std::array<int64_t, 4>& shape, ONNXTensorElementDataType type) {
  OrtValue* value = nullptr;
  check(runtime_.api().CreateTensorWithDataAsOrtValue(memory, data, bytes, shape.data(), shape.size(), type, &value),
        "must bind its memory");
  values_.emplace_back(value, runtime_.api().ReleaseValue);
  return value;
}

OrtStereoSession::OrtStereoSession(std::shared_ptr<const Runtime> runtime, std::shared_ptr<const ModelFile> model,
                                   const SessionSettings& settings, const Log& log)
    : runtime_(std::move(runtime)),
      file_(std::move(model)),
      settings_(settings),
      log_(log),
      facts_{installed_provider(*runtime_, settings.provider), settings.provider_options, runtime_->version(),
             runtime_->path(), runtime_->sha256(), runtime_->telemetry_on()},
      environment_(nullptr, runtime_->api().ReleaseEnv),
      session_(nullptr, runtime_->api().ReleaseSession) {
  open();
  read_metadata();
  check_interface(*runtime_, session_.get());
}

OrtStereoSession::OrtStereoSession(const OrtStereoSession& reader, Size input)
    : runtime_(reader.runtime_),
      file_(reader.file_),
      settings_(reader.settings_),
      log_(reader.log_.log()),
      sides_(open_sides(*runtime_, reader.session_.get(), input)),
      facts_(reader.facts_),
      info_(reader.info_),
      environment_(nullptr, runtime_->api().ReleaseEnv),
      session_(nullptr, runtime_->api().ReleaseSession) {
  open();
}

std::shared_ptr<Session> OrtStereoSession::for_size(Size input) {
  return is_reader() ? std::shared_ptr<OrtStereoSession>(new OrtStereoSession(*this, input)) : nullptr;
}

std::unique_ptr<Session::Run> OrtStereoSession::bind(SessionBuffers& buffers) {
  require(!is_reader(), ENDO_INTERNAL, "session", "must be one for a size", facts_.provider);
  return std::make_unique<BoundRun>(*this, buffers);
}

std::shared_ptr<Session> OrtStereoSession::for_one_thread_each() {
  if (facts_.provider != cpu_provider || settings_.threads == 1) return nullptr;
  const SessionSettings alone = {settings_.provider, {}, 1, false, settings_.thread_hook};
  return std::make_shared<OrtStereoSession>(runtime_, file_, alone, log_.log());
}

void OrtStereoSession::open() {
  const OrtApi& api = runtime_->api();
  const auto check = [&](OrtStatus* status) { runtime_->check(status, ENDO_INTERNAL, "runtime", "must take its settings"); };
  require_memory_for_session(settings_.threads, file_->data.size());
  OrtEnv* environment = nullptr;
  // The environment belongs to the whole process, so it prints almost nothing. Each session has its own log instead.
  check(api.CreateEnv(ORT_LOGGING_LEVEL_FATAL, "endosdk", &environment));
  environment_.reset(environment);
  OrtSessionOptions* made = nullptr;
  check(api.CreateSessionOptions(&made));
  const OrtHandle<OrtSessionOptions> options(made, api.ReleaseSessionOptions);
  check(api.SetUserLoggingFunction(options.get(), LogReader::forward, &log_));
  check(api.SetSessionLogSeverityLevel(options.get(), sides_ ? ORT_LOGGING_LEVEL_VERBOSE : log_.severity()));
  const int threads = is_reader() ? 1 : settings_.threads;
  check(api.SetIntraOpNumThreads(options.get(), threads));
  for (const auto& [key, value] : waiting_settings(settings_.spinning)) check(api.AddSessionConfigEntry(options.get(), key, value));
  if (is_reader()) check(api.SetSessionGraphOptimizationLevel(options.get(), ORT_DISABLE_ALL));
  if (sides_) add_provider(options.get());
  if (facts_.provider == cpu_provider) check(static_cast<OrtStatus*>(add_functions(&api, options.get())));
  threads_ = std::make_unique<SessionThreads>(threads - 1, settings_.thread_hook);  // the caller works, too
  threads_->offer(*runtime_, options.get());
  log_.start_reading();
  OrtSession* session = nullptr;
  OrtStatus* status =
      api.CreateSessionFromArray(environment_.get(), file_->data.data(), file_->data.size(), options.get(), &session);
  const Placement& placement = log_.stop_reading();
  threads_->end_spare();
  if (sides_) check_provider(status);
  else runtime_->check(status, ENDO_MODEL_UNREADABLE, "model", Text(file_->origin, " must be an ONNX file that runs here"));
  session_.reset(session);
  if (sides_) check_placement(facts_.provider, placement, {file_->data.data(), file_->data.size()}, file_->origin);
}

void OrtStereoSession::check_provider(OrtStatus* status) const {
  runtime_->check(status, ENDO_PROVIDER_UNAVAILABLE, "provider", Text(facts_.provider, " must start on this machine"));
}

void OrtStereoSession::add_provider(OrtSessionOptions* options) const {
  // With fixed sides, the graph has no arithmetic of shapes, which the runtime would put on the processor.
  for (const auto& [name, length] : *sides_) {
    check_provider(runtime_->api().AddFreeDimensionOverrideByName(options, name.c_str(), length));
  }
  std::vector<const char*> keys;
  std::vector<const char*> values;
  for (const auto& [key, value] : settings_.provider_options) {
    keys.push_back(key.c_str());
    values.push_back(value.c_str());
  }
  append_provider(options, keys, values);
}

void OrtStereoSession::append_provider(OrtSessionOptions* options, const std::vector<const char*>& keys,
                                       const std::vector<const char*>& values) const {
  const OrtApi& api = runtime_->api();
  if (facts_.provider == cuda_provider) {
    OrtCUDAProviderOptionsV2* cuda = nullptr;
    check_provider(api.CreateCUDAProviderOptions(&cuda));
    const OrtHandle<OrtCUDAProviderOptionsV2> held(cuda, api.ReleaseCUDAProviderOptions);
    check_provider(api.UpdateCUDAProviderOptions(cuda, keys.data(), values.data(), keys.size()));
    check_provider(api.SessionOptionsAppendExecutionProvider_CUDA_V2(options, cuda));
  } else if (facts_.provider == "TensorrtExecutionProvider") {
    OrtTensorRTProviderOptionsV2* tensorrt = nullptr;
    check_provider(api.CreateTensorRTProviderOptions(&tensorrt));
    const OrtHandle<OrtTensorRTProviderOptionsV2> held(tensorrt, api.ReleaseTensorRTProviderOptions);
    check_provider(api.UpdateTensorRTProviderOptions(tensorrt, keys.data(), values.data(), keys.size()));
    check_provider(api.SessionOptionsAppendExecutionProvider_TensorRT_V2(options, tensorrt));
  } else {
    const std::string name = call_name_of_provider(facts_.provider);
    check_provider(api.SessionOptionsAppendExecutionProvider(options, name.c_str(), keys.data(), values.data(), keys.size()));
  }
}

void OrtStereoSession::read_metadata() {
  const OrtApi& api = runtime_->api();
  const auto check = [&](OrtStatus* status) { runtime_->check(status, ENDO_MODEL_METADATA, "model", "must have metadata"); };
  OrtModelMetadata* found = nullptr;
  check(api.SessionGetModelMetadata(session_.get(), &found));
  const OrtHandle<OrtModelMetadata> metadata(found, api.ReleaseModelMetadata);
  OrtAllocator* allocator = nullptr;
  check(api.GetAllocatorWithDefaultOptions(&allocator));
  info_ = parse_metadata([&](const std::string& key) -> std::optional<std::string> {
    char* value = nullptr;
    check(api.ModelMetadataLookupCustomMetadataMap(metadata.get(), allocator, key.c_str(), &value));
    const OrtText held(value, {allocator});
    return held ? std::optional<std::string>(held.get()) : std::nullopt;
  }, file_->sha256);
}

}  // namespace endosdk
