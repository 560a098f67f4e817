// The execution providers with short names. This is the only list of them: a new provider is a new line here.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

constexpr const char* cpu_provider = "CPUExecutionProvider";
constexpr const char* cuda_provider = "CUDAExecutionProvider";
constexpr const char* openvino_provider = "OpenVINOExecutionProvider";

struct Provider {
  const char* name;           // what users write
  const char* full_name;      // ONNX Runtime's own
  const char* call_name;      // name in ONNX Runtime's general call; before version 1.22 the only one that the call takes
  bool wants_float32_models;  // it runs 8-bit models slower than float32 ones, or not at all
  bool shares_processor;      // it is a library for the processor that takes only the heavy operations
};

constexpr Provider providers[] = {
    {"cpu", cpu_provider, cpu_provider, false, true},
    {"cuda", cuda_provider, "CUDA", true, false},
    {"tensorrt", "TensorrtExecutionProvider", "TensorRT", true, false},
    {"openvino", openvino_provider, "OpenVINO", true, false},
    {"directml", "DmlExecutionProvider", "DML", true, false},
    {"coreml", "CoreMLExecutionProvider", "CoreML", true, false},
    {"xnnpack", "XnnpackExecutionProvider", "XNNPACK", true, true},
    {"webgpu", "WebGpuExecutionProvider", "WebGPU", true, false},
};

// ONNX Runtime's own name of a provider. Upper and lower case do not matter. Unknown names are returned unchanged.
std::string full_provider_name(std::string_view name);

// The name of a provider in ONNX Runtime's general call. A provider that is not in the table keeps its own name.
std::string call_name_of_provider(std::string_view name);

// Whether to prefer a float32 model to an 8-bit model, on this provider and this processor.
bool wants_float32_model(std::string_view provider);

// Whether a provider leaves light operations to the processor by design. For such a provider this costs no copy.
bool shares_processor(std::string_view provider);

}  // namespace endosdk
