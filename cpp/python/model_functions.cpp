// The functions of model files: for onnxruntime, which finds them through RegisterCustomOps, and one by one for tests.
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "functions/custom_ops.hpp"
#include "functions/function.hpp"
#include "functions/runtime_table.hpp"
#include "platform/threads.hpp"

// SessionOptions.register_custom_ops_library calls this function, with the runtime's own types.
extern "C" PYBIND11_EXPORT void* ENDOSDK_ORT_CALL RegisterCustomOps(void* options, const endosdk::runtime_table::ApiBase* base);

void* ENDOSDK_ORT_CALL RegisterCustomOps(void* options, const endosdk::runtime_table::ApiBase* base) {
  return endosdk::add_functions(base->get_api(endosdk::runtime_table::api_version), options);
}

namespace endosdk {
namespace {

// A call of a function with NumPy arrays.
class ArrayCall : public FunctionCall {
 public:
  ArrayCall(const FunctionKind& kind, const std::vector<py::array>& inputs) : kind_(kind) {
    require(static_cast<int>(inputs.size()) == kind.input_count, "inputs", Text("must be ", kind.input_count), inputs.size());
    for (size_t i = 0; i < inputs.size(); ++i) {
      inputs_.push_back(py::array::ensure(inputs[i], py::array::c_style));
      if (kind.inputs[i] == Element::uint8) require_type<uint8_t>(inputs[i], "inputs");
      else require_type<float>(inputs[i], "inputs");
    }
    outputs_.resize(static_cast<size_t>(kind.output_count));
  }

  Shape shape(int input) const override {
    const py::array& array = inputs_[static_cast<size_t>(input)];
    Shape shape(static_cast<size_t>(array.ndim()));
    std::copy_n(array.shape(), shape.size(), shape.data());
    return shape;
  }

  const void* data(int input) const override { return inputs_[static_cast<size_t>(input)].data(); }

  void* output(int place, const Shape& shape) override {
    const auto i = static_cast<size_t>(place);
    const std::vector<py::ssize_t> sides(shape.begin(), shape.end());
    outputs_[i] = kind_.outputs[i] == Element::uint8 ? py::array(py::array_t<uint8_t>(sides)) : py::array(py::array_t<float>(sides));
    return outputs_[i].mutable_data();
  }

  void run(int count, RowBody body) override {
    const py::gil_scoped_release released;
    parallel_for(count, 1, [&](int begin, int end, int) {
      for (int i = begin; i < end; ++i) body(i);
    });
  }

  const std::vector<py::array>& outputs() const { return outputs_; }

 private:
  const FunctionKind& kind_;
  std::vector<py::array> inputs_;
  std::vector<py::array> outputs_;
};

std::vector<py::array> model_function(const std::string& name, const std::vector<py::array>& inputs,
                                      const std::map<std::string, double>& settings) {
  for (int i = 0; function_kind(i) != nullptr; ++i) {
    const FunctionKind& kind = *function_kind(i);
    if (kind.name != name) continue;
    const auto function = kind.make([&](const char* wanted) {
      const auto found = settings.find(wanted);
      return found == settings.end() ? -1.0 : found->second;
    });
    ArrayCall call(kind, inputs);
    function->compute(call);
    return call.outputs();
  }
  reject("name", "must be a function that model files have", name);
}

}  // namespace

void bind_model_functions(py::module_& module) {
  module.def("model_function", &model_function, py::arg("name"), py::arg("inputs"), py::arg("settings"));
}

}  // namespace endosdk
