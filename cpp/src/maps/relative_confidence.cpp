#include "maps/relative_confidence.hpp"

#include <cmath>

#include "kernels/kernels.hpp"
#include "platform/threads.hpp"

namespace endosdk {
namespace {

constexpr int rows_per_block = 16;
constexpr double negligible = 1e-4;  // of a reach: changes no confidence by more

}  // namespace

FloatView RelativeConfidence::of(const FloatView& confidence, double reach) {
  if (std::abs(reach - 1.0) < negligible) return confidence;
  confidence_.resize(static_cast<size_t>(confidence.width) * static_cast<size_t>(confidence.height));
  const auto write_rows = [&](int begin, int end, int) {
    const ptrdiff_t first = static_cast<ptrdiff_t>(begin) * confidence.width;
    kernels().confidence_row(confidence.data + first, (end - begin) * confidence.width, static_cast<float>(reach),
                             confidence_.data() + first);
  };
  parallel_for(confidence.height, rows_per_block, write_rows);
  return {confidence_.data(), confidence.width, confidence.height};
}

}  // namespace endosdk
