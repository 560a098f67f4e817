// Checks that an ONNX file holds its own weights.
//
// An ONNX tensor may name another file that holds its numbers. ONNX Runtime reads this file from the current directory. The
// hash of the model does not cover these numbers, so a device could not know what it runs. Not every version of ONNX Runtime
// can refuse such models, so the library checks this itself.
#pragma once

#include <string>
#include <string_view>

namespace endosdk {

// Throws ENDO_MODEL_METADATA if a tensor of the model is stored in another file, and ENDO_MODEL_UNREADABLE if the bytes cannot
// be ONNX. `origin` is for the message.
void check_weights_are_inside(std::string_view model, const std::string& origin);

}  // namespace endosdk
