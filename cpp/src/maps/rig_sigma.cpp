#include "maps/rig_sigma.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

constexpr double explained = 2.5;  // standard errors

// The square of a term with its standard error on top: two thirds of the true values are smaller. Terms up to 2.5 standard
// errors count nothing, because noise explains them, and those of 5 or more count in full.
double variance_of(double value, double error) {
  const double size = std::abs(value);
  if (size <= explained * error) return 0.0;
  return std::min(1.0, size / (explained * error) - 1.0) * (size + error) * (size + error);
}

}  // namespace

RigSigma::RigSigma(const PoseError& error, const PosePattern& pattern, double focal_baseline, double limit_px)
    : pattern_(pattern), focal_baseline_(focal_baseline), limit_px_(limit_px) {
  if (!error.measured || !pattern.calibrated) return;
  for (const size_t i : {size_t{0}, size_t{1}, size_t{2}, scale_term}) {
    variance_[i] = variance_of(error.value[i], error.standard_error(static_cast<int>(i)));
    adds_ = adds_ || variance_[i] > 0.0;
  }
}

RigRow RigSigma::row(int y, double factor) const {
  const double focal = pattern_.focal_x;
  const double v = (y - pattern_.cy) / pattern_.focal_y;
  const double square = focal * factor * (focal * factor);
  const auto number = [](double value) { return static_cast<float>(value); };
  return {number(-pattern_.cx / focal), number(1.0 / focal), number(square * variance_[2] * v * v),
          number(square * (variance_[0] * v * v + variance_[scale_term])), number(square * variance_[1])};
}

void RigSigma::add(const float* depth, int y, int width, float* sigma) const {
  if (adds_) kernels().add_rig_sigma(row(y, 1.0 / focal_baseline_), depth, width, sigma);
}

void RigSigma::doubt(int y, int width, float* confidence) const {
  if (adds_) kernels().doubt_rig(row(y, 1.0 / limit_px_), width, confidence);
}

}  // namespace endosdk
