// What a frame path says of itself, for logs and support.
#include "frame_path/frame_path.hpp"
#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

std::string describe(const ModelInfo& m) {
  return JsonObject().text("name", m.name).text("version", m.version).text("sha256", m.sha256).text("license", m.license)
      .text("intended_use", m.intended_use).count("max_disparity", static_cast<uint64_t>(m.max_disparity))
      .raw("max_candidate_disparity", m.max_candidate_disparity > 0 ? std::to_string(m.max_candidate_disparity) : "null")
      .done();
}

}  // namespace

JsonObject FramePath::diagnostics() const {
  process_.check();
  const SessionFacts& s = sessions_.any().facts();
  JsonObject report;
  report.text("onnxruntime", s.runtime_version);
  report.text("onnxruntime_library", s.runtime_library).text("onnxruntime_sha256", s.runtime_sha256);
  report.text("onnxruntime_telemetry", s.telemetry_on ? "on: loaded by the host first" : "off");
  JsonObject options;
  for (const auto& [key, value] : s.provider_options) options.text(key, value);
  report.text("provider", s.provider).raw("provider_options", options.done()).count("threads", static_cast<uint64_t>(settings_.threads));
  report.text("device", identity()->device).text("kernels", kernels().name).flag("integer_units", has_integer_units()).raw("model", describe(model()));
  {
    const std::lock_guard lock(state_);
    report.raw("calibration_sha256", rig_ ? json_string(rig_->sha256()) : "null");
    // That of `rectified` where it has pictures: a stream of another size may be open.
    const std::optional<Size> picture = latest_ ? latest_->stage().picture() : picture_;
    if (picture) {
      report.count("network_width", static_cast<uint64_t>(picture->width));
      report.count("network_height", static_cast<uint64_t>(picture->height));
    }
  }
  report.number("nearest_depth_mm", nearest_depth_mm()).number("deadline_ms", settings_.deadline_ms).number("max_age_ms", settings_.max_age_ms);
  const Limits& limits = settings_.limits;  // no farthest depth is null
  report.number("min_confidence", limits.min_confidence).number("min_depth_mm", limits.min_depth_mm)
      .number("max_depth_mm", limits.max_depth_mm).number("depth_unit_mm", limits.depth_unit_mm);
  const Counters::Snapshot c = counters_.snapshot();
  report.count("frames", c.frames).count("failed", c.failed).count("late", c.late);
  JsonObject causes;  // frames that each was raised for
  for (const CauseFact& fact : cause_facts) causes.count(fact.name, c.causes[static_cast<size_t>(fact.cause)]);
  report.raw("causes", causes.done());
  report.raw("latency_ms", JsonObject().number("p50", c.p50_ms).number("p95", c.p95_ms).number("p99", c.p99_ms)
                               .number("max", c.longest_ms).done());
  // Trust, what finds out whether answers can be trusted, lies within the stages and a little after them.
  report.raw("mean_ms", JsonObject().number("rectify", c.rectify_ms).number("session", c.session_ms)
                            .number("postprocess", c.postprocess_ms).number("trust", c.trust_ms).done());
  return report;
}

}  // namespace endosdk
