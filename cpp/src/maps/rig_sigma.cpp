#include "maps/rig_sigma.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/kernels.hpp"

namespace endosdk {
namespace {

constexpr double explained = 2.5;  // standard errors

// The square of a term with its standard error on top: five in six true values are smaller. Terms up to 2.5 standard errors
// count nothing, because noise explains them, and those of 5 or more count in full.
double variance_of(double value, double error) {
  const double size = std::abs(value);
  if (size <= explained * error) return 0.0;
  return std::min(1.0, size / (explained * error) - 1.0) * (size + error) * (size + error);
}

}  // namespace

RigSigma::RigSigma(const PoseError& error, const PosePattern& pattern, double focal_baseline)
    : pattern_(pattern), focal_baseline_(focal_baseline) {
  if (!error.measured || !pattern.calibrated) return;
  for (const size_t i : {size_t{0}, size_t{1}, size_t{2}, scale_term}) {
    variance_[i] = variance_of(error.value[i], error.standard_error(static_cast<int>(i)));
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
