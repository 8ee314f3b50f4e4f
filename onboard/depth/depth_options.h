#pragma once

#include <string>

namespace vantage {

/// Of the per-pixel filter. The defaults are those measured in docs/depth.md.
struct DepthFilterOptions {
  // The prior: any inverse depth between these two is possible, each as likely.
  double min_depth_m = 0.3;
  double max_depth_m = 10;

  // The prior's Beta, and when a pixel has converged or diverged.
  double prior_inliers = 5;
  double prior_outliers = 5;
  double converged_relative_sigma = 0.025;  ///< sigma over inverse depth, both 1/m: does not depend on the scale
  double converged_inlier_ratio = 0.6;
  double diverged_inlier_ratio = 0.25;
  double settled_relative_sigma = 0.001;  ///< below it a converged pixel is no longer searched

  bool refine_poses = true;  ///< by the key frame's corners (pose_refinement.h); else poses are taken as they come

  // The match.
  double min_correlation = 0.6;       ///< of a match (zero-mean NCC)
  double image_noise = 2.0;           ///< standard deviation of a pixel, grey levels, at the most: images tell
  double min_match_sigma_px = 0.08;   ///< no match is known better: interpolation, lens
  double max_texture_sigma_px = 0.7;  ///< a patch whose gradient leaves its place less certain is not searched

  // Samples of the frame's image that an update takes at the most, about: where searches are long, every second or
  // third pixel is updated, in turns. Counted, not timed, so that the same frames give the same depth.
  double samples_per_frame = 27e6;

  /// False, with the reason in `why`, where a value makes no sense.
  bool valid(std::string* why = nullptr) const;

  /// Width of the inverse depths that are possible, 1/m.
  double inverse_range() const { return 1 / min_depth_m - 1 / max_depth_m; }
};

}  // namespace vantage
