#pragma once

#include <cmath>

#include <Eigen/Geometry>

namespace vantage::tracking {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

inline Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// Rotation of the vector `omega` (rad, axis times angle).
inline Eigen::Quaterniond rotation_exp(const Eigen::Vector3d& omega) {
  const double angle = omega.norm();
  const double half_sinc = angle < 1e-8 ? 0.5 - angle * angle / 48 : std::sin(angle / 2) / angle;
  const Eigen::Vector3d v = half_sinc * omega;
  return Eigen::Quaterniond(std::cos(angle / 2), v.x(), v.y(), v.z());
}

/// Axis times angle of a unit quaternion, angle in [0, pi].
inline Eigen::Vector3d rotation_log(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0 ? -1 : 1;
  const Eigen::Vector3d v = sign * rotation.vec();
  const double sine = v.norm();
  if (sine < 1e-9) return 2 * v;
  return 2 * std::atan2(sine, sign * rotation.w()) / sine * v;
}

/// A small motion (translation in m, then rotation in rad) as a pose: the translation is not coupled to the rotation
/// (R^3 x SO(3), not SE(3)'s exponential), which is all that a Gauss-Newton step needs.
inline Eigen::Isometry3d motion_exp(const Vector6d& xi) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = rotation_exp(xi.tail<3>()).toRotationMatrix();
  motion.translation() = xi.head<3>();
  return motion;
}

/// Inverse of motion_exp.
inline Vector6d motion_log(const Eigen::Isometry3d& motion) {
  Vector6d xi;
  xi << motion.translation(), rotation_log(Eigen::Quaterniond(motion.linear()).normalized());
  return xi;
}

/// d (motion_exp(xi) p) / d xi at xi = 0.
inline Eigen::Matrix<double, 3, 6> point_jacobian(const Eigen::Vector3d& p) {
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << Eigen::Matrix3d::Identity(), -skew(p);
  return jacobian;
}

/// The same motion with a rotation matrix that is orthonormal to the last bit again.
inline Eigen::Isometry3d renormalized(const Eigen::Isometry3d& motion) {
  Eigen::Isometry3d clean = Eigen::Isometry3d::Identity();
  clean.linear() = Eigen::Quaterniond(motion.linear()).normalized().toRotationMatrix();
  clean.translation() = motion.translation();
  return clean;
}

}  // namespace vantage::tracking
