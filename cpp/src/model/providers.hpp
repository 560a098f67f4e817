// The execution providers that have short names, written once: a new one is a new line here.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

constexpr const char* cpu_provider = "CPUExecutionProvider";
constexpr const char* cuda_provider = "CUDAExecutionProvider";

struct Provider {
  const char* name;           // what users write
  const char* full_name;      // ONNX Runtime's own
  const char* call_name;      // what its general call takes, and before version 1.22 the only one that it takes
  bool wants_float32_models;  // it runs 8-bit models slower than float32 ones, or not at all
  bool shares_processor;      // it is a library for the processor that takes the heavy operations alone
};

constexpr Provider providers[] = {
    {"cpu", cpu_provider, cpu_provider, false, true},
    {"cuda", cuda_provider, "CUDA", true, false},
    {"tensorrt", "TensorrtExecutionProvider", "TensorRT", true, false},
    {"openvino", "OpenVINOExecutionProvider", "OpenVINO", true, false},
    {"directml", "DmlExecutionProvider", "DML", true, false},
    {"coreml", "CoreMLExecutionProvider", "CoreML", true, false},
    {"xnnpack", "XnnpackExecutionProvider", "XNNPACK", true, true},
    {"webgpu", "WebGpuExecutionProvider", "WebGPU", true, false},
};

// ONNX Runtime's own name of a provider. Short and full names are taken in any case; others are left as they are.
std::string full_provider_name(std::string_view name);

// What ONNX Runtime's general call for providers takes; of one that is not in the table, its own name.
std::string call_name_of_provider(std::string_view name);

// Whether a float32 model is to be preferred to an 8-bit one: on this provider, and on this processor.
bool wants_float32_model(std::string_view provider);

// Whether a provider leaves light operations to the processor by design, which costs no copy there.
bool shares_processor(std::string_view provider);

}  // namespace endosdk
