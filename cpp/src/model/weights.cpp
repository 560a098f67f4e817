#include "model/weights.hpp"

#include <cstdint>
#include <optional>
#include <string_view>

#include "model/protobuf.hpp"
#include "platform/errors.hpp"

namespace endosdk {
namespace {

// The messages of onnx.proto that can hold tensors.
enum class Kind { model, training, graph, function, node, attribute, sparse, tensor };

// Field `field` of message `whole` holds message `part`.
struct Part {
  Kind whole;
  uint64_t field;
  Kind part;
};

constexpr Part parts[] = {
    {Kind::model, 7, Kind::graph},        {Kind::model, 20, Kind::training},   {Kind::model, 25, Kind::function},
    {Kind::training, 1, Kind::graph},     {Kind::training, 2, Kind::graph},    {Kind::graph, 1, Kind::node},
    {Kind::graph, 5, Kind::tensor},       {Kind::graph, 15, Kind::sparse},     {Kind::function, 7, Kind::node},
    {Kind::function, 11, Kind::attribute}, {Kind::node, 5, Kind::attribute},   {Kind::attribute, 5, Kind::tensor},
    {Kind::attribute, 6, Kind::graph},    {Kind::attribute, 10, Kind::tensor}, {Kind::attribute, 11, Kind::graph},
    {Kind::attribute, 22, Kind::sparse},  {Kind::attribute, 23, Kind::sparse}, {Kind::sparse, 1, Kind::tensor},
    {Kind::sparse, 2, Kind::tensor},
};
constexpr uint64_t tensor_name = 8;
constexpr uint64_t tensor_location = 14;  // 0: inside; 1: in another file

constexpr int deepest = 100;  // deepest nesting, as in protobuf itself

void check_tensor(std::string_view tensor, const std::string& origin) {
  bool inside = true;
  std::string_view name;
  Fields fields(tensor, origin);
  while (const std::optional<Field> field = fields.next()) {
    if (field->number == tensor_name) name = field->bytes;
    if (field->number == tensor_location && field->value != 0) inside = false;
  }
  require(inside, ENDO_MODEL_METADATA, "model", Text(origin, " must hold its weights itself"),
          Text("'", name, "' in another file"));
}

void check(Kind kind, std::string_view message, const std::string& origin, int depth) {
  if (kind == Kind::tensor) return check_tensor(message, origin);
  Fields fields(message, origin);
  if (depth > deepest) fields.refuse();
  while (const std::optional<Field> field = fields.next()) {
    for (const Part& p : parts) {
      if (p.whole == kind && p.field == field->number) check(p.part, field->bytes, origin, depth + 1);
    }
  }
}

}  // namespace

void check_weights_are_inside(std::string_view model, const std::string& origin) {
  check(Kind::model, model, origin, 0);
}

}  // namespace endosdk
