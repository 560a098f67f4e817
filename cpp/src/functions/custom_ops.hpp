// Functions of model files as operators of ONNX Runtime. Where a session knows them, it computes a function of that name by
// them and not by its body.
#pragma once

namespace endosdk {

// Lets the sessions of these options (OrtSessionOptions) compute functions by our loops. `api` is the runtime's table
// (OrtApi). Returns the runtime's status, null where all is well.
void* add_functions(const void* api, void* options);

}  // namespace endosdk
