// The execution providers that have short names, written once: a new one is a new line here.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

constexpr const char* cpu_provider = "CPUExecutionProvider";

struct Provider {
  const char* name;           // what users write
  const char* full_name;      // ONNX Runtime's own
  bool wants_float32_models;  // it runs 8-bit models slower than float32 ones, or not at all
};

constexpr Provider providers[] = {
    {"cpu", cpu_provider, false},
    {"cuda", "CUDAExecutionProvider", true},
    {"tensorrt", "TensorrtExecutionProvider", true},
    {"openvino", "OpenVINOExecutionProvider", true},
    {"directml", "DmlExecutionProvider", true},
    {"coreml", "CoreMLExecutionProvider", true},
    {"xnnpack", "XnnpackExecutionProvider", true},
    {"webgpu", "WebGpuExecutionProvider", true},
};

// ONNX Runtime's own name of a provider. Short and full names are taken in any case; others are left as they are.
std::string full_provider_name(std::string_view name);

// Whether a float32 model is to be preferred to an 8-bit one: on this provider, and on this processor.
bool wants_float32_model(std::string_view provider);

}  // namespace endosdk
