// Where the operations of a model run, and whether that is where they were asked to run.
//
// ONNX Runtime gives what a provider cannot compute to the processor, and says nothing. It also puts the arithmetic of
// shapes and indices there on purpose. Only the second is right.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace endosdk {

// How many operations of each kind run on each provider, by the runtime's own names.
using Placement = std::map<std::string, std::map<std::string, int>>;

// Throws ENDO_PROVIDER_UNAVAILABLE, with the counts, unless the provider computes the model: every convolution and matrix
// product, and all else but the arithmetic of shapes and indices.
void check_placement(const std::string& provider, const Placement& placement);

// Reads a placement from the lines that the runtime logs, at its most talkative, while it makes a session. Versions
// before 1.24 tell in no other way.
class PlacementLog {
 public:
  void read(std::string_view line);

  // Empty where no line of the log says.
  const Placement& placement() const { return placement_; }

 private:
  Placement placement_;
  std::map<std::string, int>* current_ = nullptr;  // of the provider whose operations follow
  int expected_ = 0;                               // operations that follow
};

}  // namespace endosdk
