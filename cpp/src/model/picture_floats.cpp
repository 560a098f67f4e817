#include "model/picture_floats.hpp"

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "model/protobuf.hpp"
#include "platform/lists.hpp"

namespace endosdk {
namespace {

// Numbers of fields and of element types in onnx.proto.
constexpr uint64_t model_graph = 7;
constexpr uint64_t graph_node = 1, graph_initializer = 5, graph_input = 11;
constexpr uint64_t node_input = 1, node_output = 2, node_name = 3, node_operation = 4, node_attribute = 5;
constexpr uint64_t attribute_name = 1, attribute_int = 3, attribute_tensor = 5, attribute_ints = 8;
constexpr uint64_t tensor_type = 2, tensor_name = 8;
constexpr uint64_t value_name = 1;
constexpr uint64_t float_types[] = {1, 10, 11, 16};  // of 32, 16 and 64 bits, and bfloat16

bool is_float(uint64_t type) { return std::find(std::begin(float_types), std::end(float_types), type) != std::end(float_types); }

// What is known of a value of the graph.
struct Value {
  bool floats = true;
  bool from_pictures = false;
};

struct Node {
  std::string name;
  std::string_view operation;
  std::vector<std::string_view> inputs, outputs;
  std::optional<bool> stated;  // whether an attribute makes its output floats
  Value value;                 // of its outputs
  bool reads = false;          // turns whole numbers into floats
};

class Graph {
 public:
  Graph(std::string_view model, const std::string& origin) : origin_(origin) {
    each(model, [&](const Field& field) {
      if (field.number == model_graph) read(field.bytes);
    });
    for (Node& node : nodes_) follow(node);
  }

  std::set<std::string> with_picture_floats() const {
    std::set<std::string> found;
    for (const Node& node : nodes_) {
      const bool computes = node.value.floats && node.value.from_pictures && !node.reads;
      if (computes && !node.name.empty()) found.insert(node.name);
    }
    return found;
  }

 private:
  template <typename Take>
  void each(std::string_view message, const Take& take) const {
    Fields fields(message, origin_);
    while (const std::optional<Field> field = fields.next()) take(*field);
  }

  void read(std::string_view graph) {
    each(graph, [&](const Field& field) {
      if (field.number == graph_node) {
        nodes_.push_back(node_of(field.bytes));
      } else if (field.number == graph_initializer) {
        std::string_view name;
        const bool floats = is_float(type_of_tensor(field.bytes, &name));
        values_[name] = {floats, false};
      } else if (field.number == graph_input) {
        each(field.bytes, [&](const Field& part) {
          if (part.number == value_name) values_[part.bytes] = {false, true};  // pictures are whole numbers
        });
      }
    });
  }

  Node node_of(std::string_view message) const {
    Node node;
    each(message, [&](const Field& field) {
      if (field.number == node_input) node.inputs.push_back(field.bytes);
      if (field.number == node_output) node.outputs.push_back(field.bytes);
      if (field.number == node_name) node.name = field.bytes;
      if (field.number == node_operation) node.operation = field.bytes;
      if (field.number == node_attribute) read_attribute(node, field.bytes);
    });
    return node;
  }

  // The attributes that say what a node gives: `to` of a Cast, and the values of constants.
  void read_attribute(Node& node, std::string_view message) const {
    std::string_view name;
    std::optional<uint64_t> number;
    std::optional<bool> tensor_floats;
    bool whole = false;
    each(message, [&](const Field& field) {
      if (field.number == attribute_name) name = field.bytes;
      if (field.number == attribute_int) number = field.value;
      if (field.number == attribute_int || field.number == attribute_ints) whole = true;
      if (field.number == attribute_tensor) tensor_floats = is_float(type_of_tensor(field.bytes, nullptr));
    });
    if (name == "to" && number) node.stated = is_float(*number);
    if (name == "value") node.stated = tensor_floats;
    if (name == "value_int" || name == "value_ints") node.stated = !whole;
  }

  uint64_t type_of_tensor(std::string_view tensor, std::string_view* name) const {
    uint64_t type = 0;
    each(tensor, [&](const Field& field) {
      if (field.number == tensor_type) type = field.value;
      if (field.number == tensor_name && name != nullptr) *name = field.bytes;
    });
    return type;
  }

  // Nodes stand after those whose outputs they take.
  void follow(Node& node) {
    std::vector<Value> taken;
    for (const std::string_view input : node.inputs) {
      const auto known = values_.find(input);
      taken.push_back(known != values_.end() ? known->second : Value{});
    }
    const std::string_view operation = node.operation;
    const bool of_shapes = is_one_of(operation, {"Shape", "Size"});
    node.value.from_pictures = !of_shapes && std::any_of(taken.begin(), taken.end(), [](const Value& v) { return v.from_pictures; });
    const size_t like = operation == "Where" ? 1 : 0;
    node.value.floats = !of_shapes && (taken.size() <= like || taken[like].floats);
    if (is_one_of(operation, {"ArgMax", "ArgMin", "NonZero", "Equal", "Less", "LessOrEqual", "Greater", "GreaterOrEqual", "And", "Or",
                              "Xor", "Not", "IsNaN", "IsInf", "QuantizeLinear"})) {
      node.value.floats = false;
    }
    if (operation == "DequantizeLinear") node.value.floats = true;
    if (is_one_of(operation, {"Cast", "Constant", "ConstantOfShape"})) node.value.floats = node.stated.value_or(true);
    node.reads = operation == "Cast" && !taken.empty() && !taken[0].floats;
    for (const std::string_view output : node.outputs) values_[output] = node.value;
  }

  const std::string& origin_;
  std::vector<Node> nodes_;
  std::map<std::string_view, Value> values_;
};

}  // namespace

std::set<std::string> nodes_with_picture_floats(std::string_view model, const std::string& origin) {
  return Graph(model, origin).with_picture_floats();
}

}  // namespace endosdk
