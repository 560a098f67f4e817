#include "frame_path/counters.hpp"

#include <algorithm>

namespace endosdk {

uint64_t Counters::add(const FrameReport& report) {
  const std::lock_guard lock(mutex_);
  latency_.add(report.total_ms);
  late_ += report.late;
  rectify_ms_ += report.rectify_ms;
  session_ms_ += report.session_ms;
  postprocess_ms_ += report.postprocess_ms;
  trust_ms_ += report.trust_ms;
  for (const CauseFact& fact : cause_facts) causes_[static_cast<size_t>(fact.cause)] += report.causes.raised(fact.cause);
  return latency_.count();
}

void Counters::add_failure() {
  const std::lock_guard lock(mutex_);
  ++failed_;
}

Counters::Snapshot Counters::snapshot() const {
  const std::lock_guard lock(mutex_);
  const auto frames = static_cast<double>(std::max<uint64_t>(1, latency_.count()));
  return {latency_.count(),           failed_,
          late_,                      causes_,
          rectify_ms_ / frames,       session_ms_ / frames,
          postprocess_ms_ / frames,   trust_ms_ / frames,
          latency_.quantile_ms(0.5),  latency_.quantile_ms(0.95),
          latency_.quantile_ms(0.99), latency_.longest_ms()};
}

}  // namespace endosdk
