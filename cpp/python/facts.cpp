// Facts that are written once, in C++. The Python package, its training, its tests and its documents read them from here.
#include <pybind11/native_enum.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <map>
#include <optional>

#include "bindings.hpp"
#include "frame_path/causes.hpp"
#include "frame_path/settings.hpp"
#include "geometry/pose_error.hpp"
#include "geometry/rig_file.hpp"
#include "geometry/rig_rules.hpp"
#include "maps/maps.hpp"
#include "maps/postprocess.hpp"
#include "maps/reasons.hpp"
#include "model/model.hpp"
#include "model/placement.hpp"
#include "model/provider_options.hpp"
#include "model/providers.hpp"
#include "model/runtime_resources.hpp"
#include "model/seal.hpp"
#include "model/weights.hpp"
#include "platform/threads.hpp"

namespace py = pybind11;

namespace endosdk {
namespace {

void bind_enums(py::module_& m) {
  auto reasons = py::native_enum<endo_reason>(m, "Reason", "enum.IntFlag", "Why a pixel is not valid: the bits of `reasons`.");
  for (const ReasonFact& fact : reason_facts) reasons.value(fact.name, fact.bit, fact.meaning);
  reasons.finalize();
  py::native_enum<Quality>(m, "Status", "enum.IntEnum", "One word on a whole frame, which follows from its causes.")
      .value("OK", Quality::ok, "nothing is wrong with the frame")
      .value("DEGRADED", Quality::degraded, "something is wrong; pixels that are valid can be used")
      .value("INVALID", Quality::invalid, "do not use this frame: no pixel is valid")
      .finalize();
  auto causes = py::native_enum<Cause>(m, "Cause", "enum.IntEnum", "What is wrong with a frame.");
  for (const CauseFact& fact : cause_facts) causes.value(fact.name, fact.cause, fact.meaning);
  causes.finalize();
}

void bind_numbers(py::module_& m) {
  m.attr("default_min_confidence") = FramePathSettings().limits.min_confidence;
  m.attr("confidence_parts") = confidence_parts;
  m.attr("rig_file_format") = rig_file_format;
  m.attr("rig_file_version") = rig_file_version;
  m.attr("plausible_baseline_mm") = py::make_tuple(plausible_baseline_mm[0], plausible_baseline_mm[1]);
  m.attr("certain_standard_errors") = certain_errors;
  m.attr("max_threads") = max_threads;
  m.attr("range_margin") = range_margin;
  m.attr("saturation_level") = saturation_level;
  m.attr("calibration_rule") = calibration_rule;
  const Upsampling upsampling;
  m.attr("upsampling_reach") = upsampling_reach;
  m.attr("upsampling_unlike") = static_cast<double>(upsampling.unlike);
  m.attr("upsampling_least_likeness") = static_cast<double>(upsampling.least_likeness);
  m.attr("upsampling_metadata") = text_of(upsampling);
}

// The table of causes, one row per cause: its measure, which side of the limits is bad, the limits, the meaning and the remedy.
void bind_causes(py::module_& m) {
  py::dict facts;
  for (const CauseFact& f : cause_facts) {
    py::dict fact;
    fact["measure"] = f.measure;
    fact["bad"] = f.bad == Bad::high ? "high" : "low";
    fact["degraded"] = f.degraded;
    fact["invalid"] = f.invalid;
    fact["meaning"] = f.meaning;
    fact["remedy"] = f.remedy;
    facts[py::cast(f.cause)] = fact;
  }
  m.attr("cause_facts") = facts;
}

void bind_maps(py::module_& m) {
  py::list maps;
  for_each_map([&](const auto& field) {
    using Value = typename std::decay_t<decltype(field)>::Value;
    maps.append(py::make_tuple(field.name, py::dtype::of<Value>(), field.metric));
  });
  m.attr("output_maps") = py::tuple(maps);
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
  m.def("parse_provider_options", &parse_provider_options, py::arg("texts"),
        "Keys and values of texts of the form key=value.");
  m.def("checked_provider_options", &checked_provider_options, py::arg("provider"), py::arg("options"),
        "The options of a provider, with whole 32-bit floats unless they say otherwise; wrong ones are refused.");
  m.def("check_placement", &check_placement, py::arg("provider"), py::arg("placement"),
        "Refuse a placement in which the provider does not compute the model.");
}

void bind_models(py::module_& m) {
  m.def("is_out_of_resources", &is_out_of_resources, py::arg("message"),
        "Whether the text of an error of ONNX Runtime says that memory or threads are used up.");
  m.def("require_memory_for_runtime", &require_memory_for_runtime,
        "Raise OutOfMemory unless the system has enough memory left to load ONNX Runtime.");
  m.def("require_memory_for_session", &require_memory_for_session, py::arg("threads"), py::arg("model_bytes"),
        "Raise OutOfMemory unless the system has enough memory left to make a session of a model file.");
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

void bind_facts(py::module_& m) {
  bind_enums(m);
  bind_numbers(m);
  bind_causes(m);
  bind_maps(m);
  bind_providers(m);
  bind_models(m);
}

}  // namespace endosdk
