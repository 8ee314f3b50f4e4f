#pragma once

#include <cstddef>
#include <vector>

#include "calib/files/trajectory.h"

namespace vantage::tracking {

/// How far an estimated trajectory is from the truth after both have been brought together.
struct TrajectoryError {
  std::size_t poses = 0;      ///< that both have (times within 1 ms)
  double rmse_m = 0;          ///< absolute trajectory error of the camera's centres (Sturm et al. 2012), truth's metres
  double scale = 1;           ///< truth's metres per estimated one
  double worst_window_m = 0;  ///< the largest rmse of any 200 frames aligned on their own
  double mean_window_m = 0;   ///< their mean
  double path_m = 0;          ///< length of the truth's way through these poses
};

/// Aligns with a similarity, or with a rigid motion when `with_scale` is false. Fewer than three poses give zeros.
/// `window_s`: length of the windows of worst_window_m; one that has less than half of its frames posed is passed over.
TrajectoryError trajectory_error(const std::vector<StampedPose>& estimate, const std::vector<StampedPose>& truth,
                                 bool with_scale, std::size_t window_frames = 200);

}  // namespace vantage::tracking
