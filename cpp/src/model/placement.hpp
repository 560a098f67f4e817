// Where the operations of a model run, and whether they run on the requested provider.
//
// ONNX Runtime silently moves operations that a provider cannot compute to the processor. It also puts the arithmetic of shapes
// and indices there on purpose. Only the second is acceptable, and so is reading pictures, where a provider has no bytes.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace endosdk {

struct PlacedNode {
  std::string operation;
  std::string name;
};

// The nodes on each provider, by the runtime's own names.
using Placement = std::map<std::string, std::vector<PlacedNode>>;

// Throws ENDO_PROVIDER_UNAVAILABLE, with the counts, unless the provider computes the model. It must compute every convolution
// and matrix product, and all other operations except the arithmetic of shapes and indices. `model` is the content of the file,
// which tells this arithmetic from that of pictures; `origin` is for errors about the file.
void check_placement(const std::string& provider, const Placement& placement, std::string_view model,
                     const std::string& origin);

// Reads a placement from the lines that the runtime logs, at its most detailed level, while it creates a session. Versions
// before 1.24 give the placement in no other way.
class PlacementLog {
 public:
  void read(std::string_view line);

  // Empty if no line of the log gave it.
  const Placement& placement() const { return placement_; }

 private:
  Placement placement_;
  std::vector<PlacedNode>* current_ = nullptr;  // of the provider whose nodes the next lines name
  size_t expected_ = 0;                         // number of these lines
};

}  // namespace endosdk
