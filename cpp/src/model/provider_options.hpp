// Options of a provider: pairs of key and value, passed to ONNX Runtime unchanged.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace endosdk {

using ProviderOptions = std::vector<std::pair<std::string, std::string>>;

// Parses texts of the form key=value. The key ends at the first '='.
ProviderOptions parse_provider_options(const std::vector<std::string>& texts);

// Returns the options. If the provider would round 32-bit floats, an option that prevents this is added, unless the caller has
// set it. Throws ENDO_INVALID_ARGUMENT for an empty key, for a key that is given twice, for an option that records graphs, and
// for any option of the processor. The provider itself refuses options that it does not know, when it starts.
ProviderOptions checked_provider_options(const std::string& provider, ProviderOptions options);

}  // namespace endosdk
