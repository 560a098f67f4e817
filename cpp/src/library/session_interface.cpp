#include "library/session_interface.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "platform/lists.hpp"

namespace endosdk {
namespace {

// One input or output of a model.
struct Node {
  std::string name;
  ONNXTensorElementDataType type = ONNX_TENSOR_ELEMENT_DATA_TYPE_UNDEFINED;
  std::vector<int64_t> shape;      // -1 where the model leaves a side open
  std::vector<std::string> names;  // name of each open side; empty for other sides
};

class Reader {
 public:
  Reader(const Runtime& runtime, const OrtSession* session) : runtime_(runtime), session_(session) {
    check(api().GetAllocatorWithDefaultOptions(&allocator_));
  }

  std::vector<Node> inputs() const {
    return nodes(api().SessionGetInputCount, api().SessionGetInputName, api().SessionGetInputTypeInfo);
  }

  std::vector<Node> outputs() const {
    return nodes(api().SessionGetOutputCount, api().SessionGetOutputName, api().SessionGetOutputTypeInfo);
  }

 private:
  const OrtApi& api() const { return runtime_.api(); }

  void check(OrtStatus* status) const {
    runtime_.check(status, ENDO_MODEL_METADATA, "model", "must describe its inputs and outputs");
  }

  template <typename Count, typename Name, typename Type>
  std::vector<Node> nodes(Count count, Name name, Type type) const {
    size_t total = 0;
    check(count(session_, &total));
    std::vector<Node> result(total);
    for (size_t i = 0; i < total; ++i) {
      char* text = nullptr;
      check(name(session_, i, allocator_, &text));
      result[i].name = OrtText(text, {allocator_}).get();
      OrtTypeInfo* made = nullptr;
      check(type(session_, i, &made));
      const OrtHandle<OrtTypeInfo> info(made, api().ReleaseTypeInfo);
      describe(*info, result[i]);
    }
    return result;
  }

  void describe(const OrtTypeInfo& info, Node& node) const {
    const OrtTensorTypeAndShapeInfo* tensor = nullptr;
    check(api().CastTypeInfoToTensorInfo(&info, &tensor));
    if (tensor == nullptr) return;  // a sequence or a map
    check(api().GetTensorElementType(tensor, &node.type));
    size_t rank = 0;
    check(api().GetDimensionsCount(tensor, &rank));
    node.shape.resize(rank);
    check(api().GetDimensions(tensor, node.shape.data(), rank));
    std::vector<const char*> names(rank);
    check(api().GetSymbolicDimensions(tensor, names.data(), rank));
    node.names.assign(names.begin(), names.end());
  }

  const Runtime& runtime_;
  const OrtSession* session_;
  OrtAllocator* allocator_ = nullptr;
};

void check_names(const std::vector<Node>& nodes, const char* argument, const char* first, const char* second) {
  std::string names;
  for (const Node& node : nodes) append_item(names, node.name);
  const auto has = [&](const char* name) {
    return std::any_of(nodes.begin(), nodes.end(), [&](const Node& node) { return node.name == name; });
  };
  require(nodes.size() == 2 && has(first) && has(second), ENDO_MODEL_METADATA, argument,
          std::string("must be ") + first + " and " + second, names.empty() ? "none" : names);
}

std::string describe(const Node& node) {
  std::string shape;
  for (const int64_t side : node.shape) append_item(shape, std::to_string(side));
  return "element type " + std::to_string(node.type) + ", shape [" + shape + "]";
}

}  // namespace

void check_interface(const Runtime& runtime, const OrtSession* session) {
  const Reader reader(runtime, session);
  const std::vector<Node> inputs = reader.inputs();
  const std::vector<Node> outputs = reader.outputs();
  check_names(inputs, "inputs", "left", "right");
  check_names(outputs, "outputs", "disparity", "confidence");
  for (const Node& node : inputs) {
    const bool fits = node.type == ONNX_TENSOR_ELEMENT_DATA_TYPE_UINT8 && node.shape.size() == 4 && node.shape[1] == 3;
    require(fits, ENDO_MODEL_METADATA, node.name, "must be uint8 [N, 3, H, W]", describe(node));
  }
  for (const Node& node : outputs) {
    const bool fits = node.type == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT && node.shape.size() == 4;
    require(fits, ENDO_MODEL_METADATA, node.name, "must be float32 [N, 1, H/s, W/s]", describe(node));
  }
}

OpenSides open_sides(const Runtime& runtime, const OrtSession* session, Size input) {
  const int64_t lengths[] = {1, 3, input.height, input.width};
  OpenSides sides;
  for (const Node& node : Reader(runtime, session).inputs()) {
    for (size_t i = 0; i < node.names.size(); ++i) {
      if (!node.names[i].empty()) sides.emplace_back(node.names[i], lengths[i]);
    }
  }
  return sides;
}

}  // namespace endosdk
