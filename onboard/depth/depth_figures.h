#pragma once

#include <span>

#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// How good a depth map is, held against the truth. "Right" is within 5 % of the true depth.
struct DepthFigures {
  double converged = 0;         ///< converged pixels, share of the image
  double precision_5 = 0;       ///< right ones, share of the converged pixels that have a truth
  double completeness_5 = 0;    ///< right ones, share of all pixels that have a truth
  double median_rel_error = 0;  ///< of the converged pixels that have a truth
};

/// `true_depth_m` is row-major, as large as the map; not positive or not finite: no truth. Figures that have nothing to
/// stand on are 0.
DepthFigures depth_figures(const DepthMap& map, std::span<const float> true_depth_m);

}  // namespace vantage
