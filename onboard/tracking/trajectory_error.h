#pragma once

#include <cstddef>
#include <vector>

#include "calib/files/trajectory.h"

namespace vantage::tracking {

/// How far an estimated trajectory is from the truth after both have been brought together.
struct TrajectoryError {
  std::size_t poses = 0;      ///< that both have (times within 20 ms, as TUM's own tools take them)
  double rmse_m = 0;          ///< absolute trajectory error of the camera's centres (Sturm et al. 2012), truth's metres
  double scale = 1;           ///< truth's metres per estimated one
  double worst_window_m = 0;  ///< the largest rmse of any window of time aligned on its own
  double mean_window_m = 0;   ///< their mean
  double path_m = 0;          ///< length of the truth's way through these poses
};

/// Aligns with a similarity, or with a rigid motion when `with_scale` is false. Fewer than three poses give zeros.
/// `window_s`: length of the windows, each a quarter of that after the last (0: none); one that holds fewer than
/// `least_poses` is passed over. \pre the times of both rise.
TrajectoryError trajectory_error(const std::vector<StampedPose>& estimate, const std::vector<StampedPose>& truth,
                                 bool with_scale, double window_s = 0, std::size_t least_poses = 3);

}  // namespace vantage::tracking
