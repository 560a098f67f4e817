// What is written once, in C++, and read by the Python package, its training, its tests and its documents.
#include <pybind11/native_enum.h>
#include <pybind11/stl.h>

#include <map>
#include <optional>

#include "bindings.hpp"
#include "frame_path/quality.hpp"
#include "maps/maps.hpp"
#include "maps/postprocess.hpp"
#include "maps/reasons.hpp"
#include "model/model.hpp"
#include "model/providers.hpp"
#include "model/weights.hpp"

namespace py = pybind11;

namespace endosdk {
namespace {

void bind_enums(py::module_& m) {
  auto reasons = py::native_enum<Reason>(m, "Reason", "enum.IntFlag", "Why a pixel is not valid: the bits of `reasons`.");
  for (const ReasonFact& fact : reason_facts) reasons.value(fact.name, fact.bit, fact.meaning);
  reasons.finalize();
  py::native_enum<Quality>(m, "Status", "enum.IntEnum", "One word on a whole frame, from the share of valid pixels.")
      .value("OK", Quality::ok, "at least least_share_ok of the pixels are valid")
      .value("DEGRADED", Quality::degraded, "fewer")
      .value("INVALID", Quality::invalid, "fewer than least_share_usable: do not use this frame")
      .finalize();
}

void bind_numbers(py::module_& m) {
  m.attr("range_margin") = range_margin;
  m.attr("least_share_ok") = least_share_ok;
  m.attr("least_share_usable") = least_share_usable;
  m.attr("calibration_rule") = calibration_rule;
  const Upsampling upsampling;
  m.attr("upsampling_reach") = upsampling_reach;
  m.attr("upsampling_unlike") = static_cast<double>(upsampling.unlike);
  m.attr("upsampling_least_likeness") = static_cast<double>(upsampling.least_likeness);
  m.attr("upsampling_metadata") = text_of(upsampling);
}

void bind_providers(py::module_& m) {
  py::dict names;
  for (const Provider& p : providers) names[p.name] = p.full_name;
  m.attr("providers") = names;
  m.attr("cpu_provider") = cpu_provider;
  m.def("full_provider_name", &full_provider_name, py::arg("name"),
        "ONNX Runtime's own name of a provider; short and full names are taken in any case.");
  m.def("wants_float32_model", &wants_float32_model, py::arg("provider"),
        "Whether a float32 model is to be preferred to an 8-bit one, on this provider and this processor.");
}

void bind_models(py::module_& m) {
  m.def(
      "parse_metadata",
      [](const std::map<std::string, std::string>& metadata, const std::string& sha256) {
        const auto lookup = [&](const std::string& key) -> std::optional<std::string> {
          const auto found = metadata.find(key);
          return found == metadata.end() ? std::nullopt : std::optional(found->second);
        };
        const ModelInfo info = parse_metadata(lookup, sha256);
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
}

}  // namespace

void bind_facts(py::module_& m) {
  bind_enums(m);
  bind_numbers(m);
  bind_providers(m);
  bind_models(m);
}

}  // namespace endosdk
