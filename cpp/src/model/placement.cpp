#include "model/placement.hpp"

#include <algorithm>
#include <charconv>

#include "model/providers.hpp"
#include "platform/errors.hpp"
#include "platform/lists.hpp"

namespace endosdk {
namespace {

// Operations on shapes and indices. The runtime keeps them on the processor, where it reads their results.
constexpr std::string_view shape_operations[] = {
    "Add",   "And",   "Cast",     "Concat", "ConstantOfShape", "Div",  "Equal",   "Expand",    "Gather",    "Greater",
    "Less",  "Max",   "Identity", "Min",    "Mod",             "Mul",  "Neg",     "Not",       "Or",        "Range",
    "Shape", "Size",  "Slice",    "Split",  "Squeeze",         "Sub",  "Reshape", "Transpose", "Unsqueeze", "Where",
    "ReduceProd", "ScatterND",
};

bool is_shape_operation(std::string_view operation) {
  return std::find(std::begin(shape_operations), std::end(shape_operations), operation) != std::end(shape_operations);
}

// The fused and 8-bit variants of heavy operations have these words in their names, too.
bool is_heavy(std::string_view operation) {
  const auto has = [&](std::string_view part) { return operation.find(part) != std::string_view::npos; };
  return has("Conv") || has("MatMul") || has("Gemm");
}

// The text between the first `begin` and the next `end`; empty if `begin` is missing.
std::string_view between(std::string_view text, std::string_view begin, std::string_view end) {
  const size_t first = text.find(begin);
  if (first == std::string_view::npos) return {};
  const std::string_view rest = text.substr(first + begin.size());
  return rest.substr(0, std::min(rest.size(), rest.find(end)));
}

}  // namespace

void check_placement(const std::string& provider, const Placement& placement) {
  const Text rule(provider, " must compute this model, but for the arithmetic of shapes");
  const auto own = placement.find(provider);
  const bool takes_part = own != placement.end() && !own->second.empty();
  require(takes_part, ENDO_PROVIDER_UNAVAILABLE, "provider", rule, "none of its operations there");
  const bool shares = shares_processor(provider);
  std::string elsewhere;
  for (const auto& [other, operations] : placement) {
    if (other == provider) continue;
    std::string listed;
    for (const auto& [operation, count] : operations) {
      const bool may_stay = shares ? !is_heavy(operation) : is_shape_operation(operation);
      if (!may_stay) append_item(listed, std::to_string(count) + " " + operation);
    }
    if (!listed.empty()) append_item(elsewhere, listed + " on " + other, "; ");
  }
  require(elsewhere.empty(), ENDO_PROVIDER_UNAVAILABLE, "provider", rule, elsewhere);
}

void PlacementLog::read(std::string_view line) {
  // The line " Node(s) placed on [NAME]. Number of nodes: N" is followed by N lines "  OPERATION (node)". If all nodes are on
  // one provider, the line begins with "All nodes", and no such lines follow.
  const std::string_view provider = between(line, "placed on [", "]. Number of nodes: ");
  if (!provider.empty()) {
    const std::string_view count = between(line, "Number of nodes: ", "\n");
    current_ = &placement_[std::string(provider)];
    expected_ = 0;
    std::from_chars(count.data(), count.data() + count.size(), expected_);
    if (line.find("All nodes") == std::string_view::npos) return;
    (*current_)["operation"] += expected_;
    expected_ = 0;
  } else if (expected_ > 0) {
    const size_t begin = line.find_first_not_of(' ');
    if (begin == std::string_view::npos) return;
    ++(*current_)[std::string(line.substr(begin, line.find(' ', begin) - begin))];
    --expected_;
  }
}

}  // namespace endosdk
