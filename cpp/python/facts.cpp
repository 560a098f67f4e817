// Facts that are written once, in C++. The Python package, its training, its tests and its documents read them from here.
#include <pybind11/native_enum.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "bindings.hpp"
#include "frame_path/causes.hpp"
#include "frame_path/settings.hpp"
#include "geometry/pose_error.hpp"
#include "geometry/rig_file.hpp"
#include "geometry/rig_rules.hpp"
#include "images/size.hpp"
#include "maps/maps.hpp"
#include "maps/postprocess.hpp"
#include "maps/reasons.hpp"
#include "model/model.hpp"
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
      .value("DEGRADED", Quality::degraded, "a cause was raised; docs/trust.md says what can be used")
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
  m.attr("longest_side") = longest_side;
  m.attr("model_key_prefix") = model_key_prefix;
  m.attr("model_format_version") = model_format_version;
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
  m.def("least_turn_deg", &least_turn, py::arg("focal_widths"), "Rotation from which RIG_MOVED is raised, with a lens of this focal length.");
}

void bind_output_maps(py::module_& m) {
  py::list maps;
  for_each_map([&](const auto& field) {
    using Value = typename std::decay_t<decltype(field)>::Value;
    maps.append(py::make_tuple(field.name, py::dtype::of<Value>(), field.metric));
  });
  m.attr("output_maps") = py::tuple(maps);
}

}  // namespace

void bind_facts(py::module_& m) {
  bind_enums(m);
  bind_numbers(m);
  bind_causes(m);
  bind_output_maps(m);
}

}  // namespace endosdk
