#include "model/placement.hpp"

#include <algorithm>
#include <charconv>
#include <set>

#include "model/picture_floats.hpp"
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

// WebGPU has none of these, which keep the columns that a model looks at within the picture.
constexpr std::string_view limits_of_columns[] = {"Max", "Min"};

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

void check_placement(const std::string& provider, const Placement& placement, std::string_view model,
                     const std::string& origin) {
  const Text rule(provider, " must compute this model, but for the arithmetic of shapes and indices");
  const auto own = placement.find(provider);
  const bool takes_part = own != placement.end() && !own->second.empty();
  require(takes_part, ENDO_PROVIDER_UNAVAILABLE, "provider", rule, "none of its operations there");
  const bool shares = shares_processor(provider);
  const std::set<std::string> of_pictures = nodes_with_picture_floats(model, origin);
  const auto may_stay = [&](const PlacedNode& node) {
    if (shares) return !is_heavy(node.operation);
    if (of_pictures.count(node.name) != 0) return is_one_of(node.operation, limits_of_columns);
    return is_one_of(node.operation, shape_operations);
  };
  std::string elsewhere;
  for (const auto& [other, nodes] : placement) {
    if (other == provider) continue;
    std::map<std::string, int> counts;
    for (const PlacedNode& node : nodes) {
      if (!may_stay(node)) ++counts[node.operation];
    }
    std::string listed;
    for (const auto& [operation, count] : counts) append_item(listed, std::to_string(count) + " " + operation);
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
    current_->insert(current_->end(), expected_, {"operation", ""});
    expected_ = 0;
  } else if (expected_ > 0) {
    const size_t begin = line.find_first_not_of(' ');
    if (begin == std::string_view::npos) return;
    current_->push_back({std::string(line.substr(begin, line.find(' ', begin) - begin)), std::string(between(line, "(", ")"))});
    --expected_;
  }
}

}  // namespace endosdk
