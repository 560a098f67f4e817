// Models and the providers that run them: names, options, metadata and seals.
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <map>
#include <string_view>

#include "bindings.hpp"
#include "metadata_lookup.hpp"
#include "model/model.hpp"
#include "model/placement.hpp"
#include "model/provider_options.hpp"
#include "model/providers.hpp"
#include "model/runtime_resources.hpp"
#include "model/seal.hpp"
#include "model/waiting.hpp"
#include "model/weights.hpp"

namespace py = pybind11;

namespace endosdk {
namespace {

void bind_providers(py::module_& m) {
  py::dict names;
  for (const Provider& p : providers) names[p.name] = p.full_name;
  m.attr("providers") = names;
  m.attr("cpu_provider") = cpu_provider;
  m.def("full_provider_name", &full_provider_name, py::arg("name"),
        "ONNX Runtime's own name of a provider; short and full names are taken in any case.");
  m.def("wants_float32_model", &wants_float32_model, py::arg("provider"),
        "Whether a float32 model is to be preferred to an 8-bit one, on this provider and this processor.");
  m.def("parse_provider_options", &parse_provider_options, py::arg("texts"),
        "Keys and values of texts of the form key=value.");
  m.def("checked_provider_options", &checked_provider_options, py::arg("provider"), py::arg("options"),
        "The options of a provider, with whole 32-bit floats unless they say otherwise; wrong ones are refused.");
  m.def(
      "check_placement",
      [](const std::string& provider, const std::map<std::string, std::vector<std::pair<std::string, std::string>>>& nodes,
         const py::bytes& model, const std::string& origin) {
        Placement placement;
        for (const auto& [name, placed] : nodes) {
          std::vector<PlacedNode>& there = placement[name];
          for (const auto& [operation, node] : placed) there.push_back({operation, node});
        }
        check_placement(provider, placement, std::string_view(model), origin);
      },
      py::arg("provider"), py::arg("nodes"), py::arg("model"), py::arg("origin"),
      "Refuse a placement, (operation, name) of the nodes on each provider, in which the provider does not compute the model.");
  m.def(
      "waiting_settings",
      [](bool polls) {
        std::map<std::string, std::string> settings;
        for (const auto& [key, value] : waiting_settings(polls)) settings.emplace(key, value);
        return settings;
      },
      py::arg("polls"), "How threads of ONNX Runtime wait for one another: settings of its sessions.");
}

void bind_files(py::module_& m) {
  m.def("is_out_of_resources", &is_out_of_resources, py::arg("message"),
        "Whether the text of an error of ONNX Runtime says that memory or threads are used up.");
  m.def("require_memory_for_runtime", &require_memory_for_runtime,
        "Raise OutOfMemory unless the system has enough memory left to load ONNX Runtime.");
  m.def("require_memory_for_session", &require_memory_for_session, py::arg("threads"), py::arg("model_bytes"),
        "Raise OutOfMemory unless the system has enough memory left to make a session of a model file.");
  m.def(
      "parse_metadata",
      [](const std::map<std::string, std::string>& metadata, const std::string& sha256) {
        const ModelInfo info = parse_metadata(lookup_in(metadata), sha256);
        const auto or_none = [](int value) -> py::object { return value > 0 ? py::cast(value) : py::none(); };
        py::dict fields;
        fields["name"] = info.name;
        fields["version"] = info.version;
        fields["input_multiple"] = info.input_multiple;
        fields["output_stride"] = info.output_stride;
        fields["max_disparity"] = info.max_disparity;
        fields["max_candidate_disparity"] = or_none(info.max_candidate_disparity);
        fields["inference_width"] = or_none(info.inference_width);
        fields["upsampling"] = text_of(info.upsampling);
        fields["channel_order"] = "rgb";  // the only one of this format
        fields["license"] = info.license;
        fields["intended_use"] = info.intended_use;
        fields["training"] = info.training;
        fields["sha256"] = info.sha256;
        return fields;
      },
      py::arg("metadata"), py::arg("sha256"), "What a model says of itself; names the key that is missing or wrong.");
  m.def(
      "check_weights_are_inside",
      [](const py::bytes& model, const std::string& origin) {
        const std::string_view data = model;
        const py::gil_scoped_release release;
        check_weights_are_inside(data, origin);
      },
      py::arg("model"), py::arg("origin"), "Refuse a model that keeps weights in another file.");
  m.attr("seal_key") = seal_key;
  m.attr("empty_seal") = empty_seal();
  m.attr("seal_mark") = py::bytes(seal_mark.data(), seal_mark.size());
  m.def(
      "check_seal",
      [](const py::bytes& model, const std::string& origin) {
        const std::string_view data = model;
        const py::gil_scoped_release release;
        return check_seal(data, origin);
      },
      py::arg("model"), py::arg("origin"), "Whether a model is sealed; refuses one that was changed since.");
  m.def("seal", [](const py::bytes& model) { return py::bytes(seal(std::string_view(model))); }, py::arg("model"),
        "The bytes of a model that is to be sealed, with its hash inside.");
}

}  // namespace

void bind_models(py::module_& m) {
  bind_providers(m);
  bind_files(m);
}

}  // namespace endosdk
