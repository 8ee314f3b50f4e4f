#include "onboard/depth/depth_figures.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace vantage {

DepthFigures depth_figures(const DepthMap& map, std::span<const float> true_depth_m) {
  constexpr float kRight = 0.05F;
  if (true_depth_m.size() != map.depth_m.size()) {
    throw std::invalid_argument("depth_figures: map and truth have different sizes");
  }
  std::size_t converged = 0, with_truth = 0, right = 0;
  std::vector<float> errors;
  for (std::size_t i = 0; i < true_depth_m.size(); ++i) {
    const bool known = map.state[i] == DepthState::kConverged;
    const bool truth = std::isfinite(true_depth_m[i]) && true_depth_m[i] > 0;
    converged += known ? 1 : 0;
    with_truth += truth ? 1 : 0;
    if (!known || !truth) continue;
    errors.push_back(std::abs(map.depth_m[i] - true_depth_m[i]) / true_depth_m[i]);
    right += errors.back() <= kRight ? 1 : 0;
  }
  const auto share = [](std::size_t part, std::size_t whole) {
    return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
  };
  DepthFigures figures;
  figures.converged = share(converged, map.state.size());
  figures.precision_5 = share(right, errors.size());
  figures.completeness_5 = share(right, with_truth);
  if (!errors.empty()) {
    const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
    std::nth_element(errors.begin(), middle, errors.end());
    figures.median_rel_error = *middle;
  }
  return figures;
}

}  // namespace vantage
