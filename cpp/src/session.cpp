#include "session.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <limits>
#include <optional>

#include "session_interface.hpp"

namespace endosdk {
namespace {

struct ShortName {
  const char* name;
  const char* full;
};

constexpr const char* cpu_provider = "CPUExecutionProvider";
constexpr ShortName short_names[] = {
    {"cpu", cpu_provider}, {"cuda", "CUDAExecutionProvider"}, {"tensorrt", "TensorrtExecutionProvider"}};

// The runtime takes the size of one dimension as a multiple; this side length is far beyond any frame.
constexpr int64_t longest_side = 1 << 20;

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::vector<std::string> available_providers(const Runtime& runtime) {
  char** names = nullptr;
  int count = 0;
  runtime.check(runtime.api().GetAvailableProviders(&names, &count), ENDO_INTERNAL, "runtime", "must list its providers");
  std::vector<std::string> result(names, names + count);
  runtime.check(runtime.api().ReleaseAvailableProviders(names, count), ENDO_INTERNAL, "runtime", "must free its list");
  return result;
}

std::string full_provider_name(const Runtime& runtime, const std::string& wanted) {
  std::string name = wanted;
  for (const ShortName& known : short_names) {
    if (lower(wanted) == known.name) name = known.full;
  }
  const std::vector<std::string> available = available_providers(runtime);
  require(std::find(available.begin(), available.end(), name) != available.end(), ENDO_PROVIDER_UNAVAILABLE, "provider",
          Text("must be one that this ONNX Runtime has (", join(available), ")"), "'" + wanted + "'");
  return name;
}

// Called from within the runtime, which no exception of the host's function may enter.
void ORT_API_CALL forward_log(void* log, OrtLoggingLevel severity, const char*, const char*, const char*,
                              const char* message) {
  const endo_log_level level = severity >= ORT_LOGGING_LEVEL_ERROR     ? ENDO_LOG_ERROR
                               : severity == ORT_LOGGING_LEVEL_WARNING ? ENDO_LOG_WARNING
                                                                       : ENDO_LOG_INFO;
  try {
    (*static_cast<const Log*>(log))(level, message);
  } catch (...) {
    // The line is lost; the frame is not.
  }
}

int padded(int length, int multiple) {
  const int64_t result = (int64_t{length} + multiple - 1) / multiple * multiple;
  require(result <= longest_side, ENDO_INVALID_ARGUMENT, "size",
          Text("must be at most ", longest_side, " px after padding"), result);
  return static_cast<int>(result);
}

}  // namespace

Session::Session(std::shared_ptr<const Runtime> runtime, const ModelFile& model, const SessionSettings& settings,
                 const Log& log)
    : runtime_(std::move(runtime)),
      log_(log),
      provider_(full_provider_name(*runtime_, settings.provider)),
      model_sha256_(model.sha256),
      environment_(nullptr, runtime_->api().ReleaseEnv),
      session_(nullptr, runtime_->api().ReleaseSession),
      run_options_(nullptr, runtime_->api().ReleaseRunOptions) {
  open(model, settings);
  read_metadata();
  check_interface(*runtime_, session_.get());
  OrtRunOptions* run_options = nullptr;
  runtime_->check(runtime_->api().CreateRunOptions(&run_options), ENDO_INTERNAL, "runtime", "must make run options");
  run_options_.reset(run_options);
}

void Session::open(const ModelFile& model, const SessionSettings& settings) {
  const OrtApi& api = runtime_->api();
  const auto check = [&](OrtStatus* status) { runtime_->check(status, ENDO_INTERNAL, "runtime", "must take its settings"); };
  OrtEnv* environment = nullptr;
  // The environment is the whole process's; what it would print goes to each session's own log instead.
  check(api.CreateEnv(ORT_LOGGING_LEVEL_FATAL, "endosdk", &environment));
  environment_.reset(environment);
  OrtSessionOptions* made = nullptr;
  check(api.CreateSessionOptions(&made));
  const OrtHandle<OrtSessionOptions> options(made, api.ReleaseSessionOptions);
  const bool wants_info = log_.level >= ENDO_LOG_INFO;
  check(api.SetUserLoggingFunction(options.get(), forward_log, &log_));
  check(api.SetSessionLogSeverityLevel(options.get(), wants_info ? ORT_LOGGING_LEVEL_INFO : ORT_LOGGING_LEVEL_ERROR));
  check(api.SetIntraOpNumThreads(options.get(), settings.threads));
  check(api.AddSessionConfigEntry(options.get(), "session.intra_op.allow_spinning", settings.spinning ? "1" : "0"));
  // Waiting threads must not burn the cores that rectification and post-processing need between two runs.
  check(api.AddSessionConfigEntry(options.get(), "session.force_spinning_stop", "1"));
  add_provider(options.get());
  OrtSession* session = nullptr;
  runtime_->check(api.CreateSessionFromArray(environment_.get(), model.data.data(), model.data.size(), options.get(), &session),
                  ENDO_MODEL_UNREADABLE, "model", Text(model.origin, " must be an ONNX file that runs here"));
  session_.reset(session);
}

void Session::add_provider(OrtSessionOptions* options) const {
  const OrtApi& api = runtime_->api();
  const auto check = [&](OrtStatus* status) {
    runtime_->check(status, ENDO_PROVIDER_UNAVAILABLE, "provider", Text(provider_, " must start on this machine"));
  };
  if (provider_ == cpu_provider) return;
  // A node that cannot run on the accelerator is an error, never a silent move to the processor.
  check(api.AddSessionConfigEntry(options, "session.disable_cpu_ep_fallback", "1"));
  if (provider_ == short_names[1].full) {
    OrtCUDAProviderOptionsV2* cuda = nullptr;
    check(api.CreateCUDAProviderOptions(&cuda));
    const OrtHandle<OrtCUDAProviderOptionsV2> held(cuda, api.ReleaseCUDAProviderOptions);
    check(api.SessionOptionsAppendExecutionProvider_CUDA_V2(options, cuda));
  } else if (provider_ == short_names[2].full) {
    OrtTensorRTProviderOptionsV2* tensorrt = nullptr;
    check(api.CreateTensorRTProviderOptions(&tensorrt));
    const OrtHandle<OrtTensorRTProviderOptionsV2> held(tensorrt, api.ReleaseTensorRTProviderOptions);
    check(api.SessionOptionsAppendExecutionProvider_TensorRT_V2(options, tensorrt));
  } else {
    // The runtime's general call wants the name without its common ending.
    const std::string ending = "ExecutionProvider";
    const std::string name = provider_.substr(0, provider_.size() - std::min(provider_.size(), ending.size()));
    check(api.SessionOptionsAppendExecutionProvider(options, name.c_str(), nullptr, nullptr, 0));
  }
}

void Session::read_metadata() {
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
  });
}

void Session::run(Buffers& buffers) {
  runtime_->check(runtime_->api().RunWithBinding(session_.get(), run_options_.get(), buffers.binding_.get()),
                  ENDO_INFERENCE_FAILED, "session", "must run on this provider");
}

void Session::terminate() {
  runtime_->check(runtime_->api().RunOptionsSetTerminate(run_options_.get()), ENDO_INTERNAL, "session", "must stop");
}

void Session::resume() {
  runtime_->check(runtime_->api().RunOptionsUnsetTerminate(run_options_.get()), ENDO_INTERNAL, "session", "must go on");
}

Session::Buffers::Buffers(const Session& session, Size picture)
    : input_{padded(picture.width, session.info().input_multiple), padded(picture.height, session.info().input_multiple)},
      grid_{input_.width / session.info().output_stride, input_.height / session.info().output_stride},
      binding_(nullptr, session.runtime().api().ReleaseIoBinding) {
  const Runtime& runtime = session.runtime();
  const OrtApi& api = runtime.api();
  const auto check = [&](OrtStatus* status) { runtime.check(status, ENDO_INTERNAL, "runtime", "must bind its memory"); };
  require(grid_.width > 0 && grid_.height > 0, ENDO_INVALID_ARGUMENT, "size", "must give the network at least one cell",
          Text(input_.width, "x", input_.height));
  const size_t input = size_t{3} * static_cast<size_t>(input_.width) * static_cast<size_t>(input_.height);
  const size_t grid = static_cast<size_t>(grid_.width) * static_cast<size_t>(grid_.height);
  pixels_.resize(2 * input);
  maps_.resize(2 * grid);

  OrtIoBinding* binding = nullptr;
  check(api.CreateIoBinding(session.session_.get(), &binding));
  binding_.reset(binding);
  OrtMemoryInfo* info = nullptr;
  check(api.CreateCpuMemoryInfo(OrtDeviceAllocator, OrtMemTypeDefault, &info));
  const OrtHandle<OrtMemoryInfo> memory(info, api.ReleaseMemoryInfo);
  values_.reserve(4);
  const auto wrap = [&](void* data, size_t bytes, int64_t channels, Size size, ONNXTensorElementDataType type) {
    const std::array<int64_t, 4> shape = {1, channels, size.height, size.width};
    OrtValue* value = nullptr;
    check(api.CreateTensorWithDataAsOrtValue(memory.get(), data, bytes, shape.data(), shape.size(), type, &value));
    values_.emplace_back(value, api.ReleaseValue);
    return value;
  };
  for (const size_t second : {0, 1}) {
    const char* const name = second ? "right" : "left";
    OrtValue* value = wrap(pixels_.data() + second * input, input, 3, input_, ONNX_TENSOR_ELEMENT_DATA_TYPE_UINT8);
    check(api.BindInput(binding_.get(), name, value));
  }
  for (const size_t second : {0, 1}) {
    const char* const name = second ? "confidence" : "disparity";
    OrtValue* value = wrap(maps_.data() + second * grid, grid * sizeof(float), 1, grid_, ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT);
    check(api.BindOutput(binding_.get(), name, value));
  }
}

PlanarView Session::Buffers::left() { return {pixels_.data(), input_.width, input_.height}; }

PlanarView Session::Buffers::right() { return {pixels_.data() + pixels_.size() / 2, input_.width, input_.height}; }

FloatView Session::Buffers::disparity() const { return {maps_.data(), grid_.width, grid_.height}; }

FloatView Session::Buffers::confidence() const { return {maps_.data() + maps_.size() / 2, grid_.width, grid_.height}; }

}  // namespace endosdk
