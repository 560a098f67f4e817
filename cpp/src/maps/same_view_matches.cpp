#include "maps/same_view_matches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace endosdk {

double matches_from_one_picture(const MatchedViews& views, Size picture, double right_shift, std::vector<double>& apart) {
  constexpr int step = same_view_step;
  constexpr double least_share = 0.125;  // of these cells
  constexpr double share = 0.8;
  const Size cells = views.size();
  apart.clear();
  int looked_at = 0;
  for (int y = step / 2; y < cells.height; y += step) {
    for (int x = step / 2; x < cells.width; x += step, ++looked_at) {
      const double disparity = static_cast<double>(views.disparity(y)[x]) * views.unit() - right_shift;
      if (!std::isnan(disparity)) apart.push_back(std::abs(disparity));
    }
  }
  if (apart.empty() || static_cast<double>(apart.size()) < least_share * looked_at) return std::numeric_limits<double>::infinity();
  const auto at = apart.begin() + static_cast<ptrdiff_t>(share * static_cast<double>(apart.size() - 1));
  std::nth_element(apart.begin(), at, apart.end());
  return *at * 1000.0 / picture.width;
}

}  // namespace endosdk
