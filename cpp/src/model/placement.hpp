// Where the operations of a model run, and whether they run on the requested provider.
//
// ONNX Runtime silently moves operations that a provider cannot compute to the processor. It also puts the arithmetic of shapes
// and indices there on purpose. Only the second is acceptable.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace endosdk {

// Number of operations of each kind on each provider, by the runtime's own names.
using Placement = std::map<std::string, std::map<std::string, int>>;

// Throws ENDO_PROVIDER_UNAVAILABLE, with the counts, unless the provider computes the model. It must compute every convolution
// and matrix product, and all other operations except the arithmetic of shapes and indices.
void check_placement(const std::string& provider, const Placement& placement);

// Reads a placement from the lines that the runtime logs, at its most detailed level, while it creates a session. Versions
// before 1.24 give the placement in no other way.
class PlacementLog {
 public:
  void read(std::string_view line);

  // Empty if no line of the log gave it.
  const Placement& placement() const { return placement_; }

 private:
  Placement placement_;
  std::map<std::string, int>* current_ = nullptr;  // counts of the provider whose operations the next lines name
  int expected_ = 0;                               // number of these lines
};

}  // namespace endosdk
