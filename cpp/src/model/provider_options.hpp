// Options of a provider: texts by key, handed to ONNX Runtime as they are.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace endosdk {

using ProviderOptions = std::vector<std::pair<std::string, std::string>>;

// From texts of the form key=value. The key ends at the first '='.
ProviderOptions parse_provider_options(const std::vector<std::string>& texts);

// Returns the options and what makes the provider compute in whole 32-bit floats where it would round them, unless they
// say otherwise. Throws ENDO_INVALID_ARGUMENT for an empty key, a key that stands twice, and any option of the
// processor. What the provider itself does not know, it refuses when it starts.
ProviderOptions checked_provider_options(const std::string& provider, ProviderOptions options);

}  // namespace endosdk
