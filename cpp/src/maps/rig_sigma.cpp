#include "maps/rig_sigma.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {
namespace {

constexpr double explained = 2.5;  // standard errors

}  // namespace

RigSigma::RigSigma(const PoseError& error, const PosePattern& pattern, double focal_baseline)
    : pattern_(pattern), focal_baseline_(focal_baseline) {
  if (!error.measured || !pattern.calibrated) return;
  for (size_t i = 0; i < variance_.size(); ++i) {
    const double certain = explained * error.standard_error(static_cast<int>(i));
    variance_[i] = std::max(0.0, error.value[i] * error.value[i] - certain * certain);
    adds_ = adds_ || variance_[i] > 0.0;
  }
}

void RigSigma::add(const float* depth, int y, int width, float* sigma) const {
  if (!adds_) return;
  for (int x = 0; x < width; ++x) {
    const std::array<double, 3> moved = pattern_.columns(x, y);
    double square = 0.0;
    for (size_t i = 0; i < moved.size(); ++i) square += variance_[i] * moved[i] * moved[i];
    const double mm = static_cast<double>(depth[x]) * static_cast<double>(depth[x]) / focal_baseline_;
    const auto before = static_cast<double>(sigma[x]);
    sigma[x] = static_cast<float>(std::sqrt(before * before + mm * mm * square));
  }
}

}  // namespace endosdk
