#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "calib/camera_model.h"

namespace vantage {

/// What the sensor knows of one pixel's depth.
enum class DepthState : std::uint8_t {
  kInvalid = 0,    ///< no measurement (no match, occluded, outside the sensor's range)
  kConverged = 1,  ///< depth and sigma may be used
  kEdge = 2,       ///< measured beside a depth edge: the value may belong to either side
  kUpdating = 3,   ///< a filter's estimate that has not converged yet
  kDiverged = 4    ///< a filter's estimate that was given up
};

/// True when every entry is finite and the linear part is a rotation (to 1e-4).
bool is_rigid(const Eigen::Isometry3d& pose);

/// The depth image of one key frame, as it goes from robot to workstation.
///
/// All images are row-major, width x height of `camera`, which has no distortion. `depth_m` is along the camera's z
/// axis, not along the ray. `sigma_m` is the standard deviation of `depth_m`. Both mean something only where `state` is
/// neither kInvalid nor kDiverged.
struct DepthMap {
  std::int64_t utime = 0;     ///< capture time, microseconds
  std::uint64_t session = 0;  ///< chosen by the robot at boot
  std::int64_t map_id = 0;    ///< counts up within the session, from 1
  std::int64_t goal_id = 0;   ///< the motion goal it answers; 0: none
  std::int64_t view_id = -1;  ///< the goal's candidate view; -1: none
  CameraModel camera;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  std::vector<float> depth_m;
  std::vector<float> sigma_m;
  std::vector<DepthState> state;

  /// False, with the reason in `why`: an image of another size than the camera's, a pose that is not finite or not a
  /// rotation, a usable pixel whose depth or sigma is not finite and positive.
  bool valid(std::string* why = nullptr) const;
};

}  // namespace vantage
