#include "frame_path/counters.hpp"

namespace endosdk {

uint64_t Counters::add(const FrameReport& report) {
  const std::lock_guard lock(mutex_);
  latency_.add(report.total_ms);
  late_ += report.late;
  for (const CauseFact& fact : cause_facts) causes_[static_cast<size_t>(fact.cause)] += report.causes.raised(fact.cause);
  return latency_.count();
}

void Counters::add_failure() {
  const std::lock_guard lock(mutex_);
  ++failed_;
}

Counters::Snapshot Counters::snapshot() const {
  const std::lock_guard lock(mutex_);
  return {latency_.count(),           failed_,
          late_,                      causes_,
          latency_.quantile_ms(0.5),  latency_.quantile_ms(0.95),
          latency_.quantile_ms(0.99), latency_.longest_ms()};
}

}  // namespace endosdk
