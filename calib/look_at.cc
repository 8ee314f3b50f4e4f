#include "calib/look_at.h"

namespace vantage {

Eigen::Isometry3d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ());
  right = right.norm() < 1e-6 ? Eigen::Vector3d(-Eigen::Vector3d::UnitY()) : Eigen::Vector3d(right.normalized());
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  T_world_camera.linear().col(0) = right;
  T_world_camera.linear().col(1) = forward.cross(right);
  T_world_camera.linear().col(2) = forward;
  T_world_camera.translation() = eye;
  return T_world_camera;
}

}  // namespace vantage
