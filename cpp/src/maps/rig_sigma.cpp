#include "maps/rig_sigma.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr double explained = 2.5;  // standard errors

}  // namespace

RigSigma::RigSigma(const PoseError& error, const PosePattern& pattern, double focal_baseline)
    : pattern_(pattern), focal_baseline_(focal_baseline) {
  if (!error.measured || !pattern.calibrated) return;
  for (const size_t i : {size_t{0}, size_t{1}, size_t{2}, scale_term}) {
    const double certain = explained * error.standard_error(static_cast<int>(i));
    variance_[i] = std::max(0.0, error.value[i] * error.value[i] - certain * certain);
    adds_ = adds_ || variance_[i] > 0.0;
  }
}

void RigSigma::add(const float* depth, int y, int width, float* sigma) const {
  if (!adds_) return;
  const double focal = pattern_.focal_x;
  const double v = (y - pattern_.cy) / pattern_.focal_y;
  const double per_px = focal / focal_baseline_ * (focal / focal_baseline_);
  const auto number = [](double value) { return static_cast<float>(value); };
  kernels().add_rig_sigma({depth, sigma, width, number(-pattern_.cx / focal), number(1.0 / focal), number(per_px * variance_[2] * v * v),
                           number(per_px * (variance_[0] * v * v + variance_[scale_term])), number(per_px * variance_[1])});
}

}  // namespace endosdk
