#include "model/provider_options.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <string_view>

#include "model/providers.hpp"
#include "platform/errors.hpp"
#include "platform/lists.hpp"

namespace endosdk {
namespace {

constexpr const char* argument = "provider_options";

// These options record the work of one frame and repeat it with the same memory. Here, each frame uses other memory of the
// provider.
constexpr std::array<std::string_view, 3> recording = {"enable_cuda_graph", "trt_cuda_graph_enable", "enableGraphCapture"};

bool is_recording(const std::string& key, const std::string& value) {
  const bool off = value == "0" || value == "false" || value == "False";
  return !off && std::find(recording.begin(), recording.end(), key) != recording.end();
}

// By default, CUDA rounds the factors of convolutions to 10 bits, and OpenVINO computes with 16 bits on a GPU. This changes the
// disparities of a float32 model.
struct WholeFloats {
  std::string_view provider, key, value;
};
constexpr std::array<WholeFloats, 2> whole_floats = {{
    {cuda_provider, "use_tf32", "0"},
    {openvino_provider, "precision", "ACCURACY"},
}};

void check(const std::string& provider, const ProviderOptions& options) {
  std::set<std::string> seen;
  for (const auto& [key, value] : options) {
    require(!key.empty(), argument, "must have a key before the '='", in_quotes("=" + value));
    require(seen.insert(key).second, argument, "must give a key once", in_quotes(key));
    require(!is_recording(key, value), argument, "must not record graphs, which would answer every frame as the recorded one",
            in_quotes(key + "=" + value));
  }
  require(options.empty() || provider != cpu_provider, argument, "must be empty for the processor, which takes none",
          options.empty() ? "" : in_quotes(options.front().first));
}

}  // namespace

ProviderOptions parse_provider_options(const std::vector<std::string>& texts) {
  ProviderOptions options;
  for (const std::string& text : texts) {
    const size_t sign = text.find('=');
    require(sign != std::string::npos, argument, "must be of the form key=value", in_quotes(text));
    options.emplace_back(text.substr(0, sign), text.substr(sign + 1));
  }
  return options;
}

ProviderOptions checked_provider_options(const std::string& provider, ProviderOptions options) {
  const std::string name = full_provider_name(provider);
  check(name, options);
  for (const WholeFloats& added : whole_floats) {
    // An older way to state the precision for OpenVINO is a suffix of the device, as in GPU_FP16.
    const auto chosen = [&](const auto& option) {
      return option.first == added.key || (option.first == "device_type" && option.second.find("_FP") != std::string::npos);
    };
    const bool free = std::none_of(options.begin(), options.end(), chosen);
    if (free && name == added.provider) options.emplace_back(added.key, added.value);
  }
  return options;
}

}  // namespace endosdk
