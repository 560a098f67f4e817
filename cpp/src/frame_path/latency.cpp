#include "frame_path/latency.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {

void LatencyHistogram::add(double milliseconds) {
  const double octaves = std::log2(std::max(milliseconds, first_ms) / first_ms);
  const size_t bin = static_cast<size_t>(octaves * steps_per_octave);
  ++bins_[std::min(bin, bins_.size() - 1)];
  ++count_;
  longest_ms_ = std::max(longest_ms_, milliseconds);
}

double LatencyHistogram::quantile_ms(double share) const {
  const double wanted = share * static_cast<double>(count_);
  uint64_t seen = 0;
  for (size_t bin = 0; bin < bins_.size(); ++bin) {
    seen += bins_[bin];
    if (seen > 0 && static_cast<double>(seen) >= wanted) {
      const double upper = first_ms * std::exp2((static_cast<double>(bin) + 1.0) / steps_per_octave);
      return std::min(upper, longest_ms_);
    }
  }
  return 0.0;
}

}  // namespace endosdk
