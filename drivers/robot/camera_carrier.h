#pragma once

#include <Eigen/Geometry>

namespace vantage {

/// Whatever holds the camera and can put it somewhere: the simulator's free flight today, an arm on a base later.
class CameraCarrier {
 public:
  virtual ~CameraCarrier() = default;

  /// Brings the camera to a pose at once; the caller keeps the steps small enough for the speed limits. False when the
  /// carrier has gone, or the pose is not a rigid motion.
  virtual bool set_pose(const Eigen::Isometry3d& T_world_camera) = 0;

  /// False when the carrier has gone. Does not wait.
  virtual bool alive() = 0;
};

}  // namespace vantage
