// Whether an ONNX file holds its own weights.
//
// ONNX lets a tensor name a file that holds its numbers, and ONNX Runtime reads it from the current directory. Such
// numbers are not covered by the hash of the model, so a device could not know what it runs. ONNX Runtime has no way to
// refuse this in every version, so the library looks itself.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

// Throws ENDO_MODEL_METADATA when a tensor of the model is kept in another file, ENDO_MODEL_UNREADABLE when the bytes
// cannot be ONNX. `origin` is for the message.
void check_weights_are_inside(std::string_view model, const std::string& origin);

}  // namespace endosdk
