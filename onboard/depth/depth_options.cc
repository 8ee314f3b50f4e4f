#include "onboard/depth/depth_options.h"

#include <cmath>

namespace vantage {
namespace {

bool fail(std::string* why, const char* reason) {
  if (why != nullptr) *why = reason;
  return false;
}

}  // namespace

bool DepthFilterOptions::valid(std::string* why) const {
  if (!(min_depth_m > 0 && max_depth_m > min_depth_m && std::isfinite(max_depth_m))) {
    return fail(why, "the nearest depth must be positive and less than the farthest");
  }
  if (!(prior_inliers > 0 && prior_outliers > 0)) return fail(why, "the prior's Beta needs two positive numbers");
  if (!(converged_relative_sigma > 0 && converged_relative_sigma < 1)) {
    return fail(why, "the relative sigma of convergence must lie between 0 and 1");
  }
  if (!(settled_relative_sigma >= 0 && settled_relative_sigma <= converged_relative_sigma)) {
    return fail(why, "a pixel can't settle before it converges");
  }
  if (!(diverged_inlier_ratio >= 0 && diverged_inlier_ratio < converged_inlier_ratio && converged_inlier_ratio < 1)) {
    return fail(why, "inlier ratios: 0 <= diverged < converged < 1");
  }
  if (!(min_correlation > 0 && min_correlation < 1)) return fail(why, "the correlation must lie between 0 and 1");
  if (!(image_noise > 0 && min_match_sigma_px > 0 && max_texture_sigma_px > 0)) {
    return fail(why, "noise and match sigmas must be positive");
  }
  if (!(samples_per_frame >= 1e5)) return fail(why, "samples per frame: at least 100,000");
  return true;
}

}  // namespace vantage
