#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// The pose that a message carries in `position` (m) and `quaternion_xyzw`. Nothing when a number is not finite or the
/// quaternion is not of unit length (to 1e-6).
template <typename Message>
std::optional<Eigen::Isometry3d> pose_of(const Message& message) {
  const double* q = message.quaternion_xyzw;
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (!(std::abs(rotation.norm() - 1) < 1e-6)) return std::nullopt;
  const Eigen::Isometry3d pose =
      Eigen::Translation3d(message.position[0], message.position[1], message.position[2]) * rotation.normalized();
  if (!is_rigid(pose)) return std::nullopt;
  return pose;
}

/// Writes a rigid pose into the message's `position` and `quaternion_xyzw`.
template <typename Message>
void set_pose(const Eigen::Isometry3d& pose, Message* message) {
  const Eigen::Quaterniond rotation(pose.linear());
  for (int i = 0; i < 3; ++i) message->position[i] = pose.translation()[i];
  for (int i = 0; i < 4; ++i) message->quaternion_xyzw[i] = rotation.coeffs()[i];
}

}  // namespace vantage
