#pragma once

#include <span>

#include <Eigen/Geometry>

namespace vantage::tracking {

/// A rigid motion and a scale: x -> s R x + t.
struct Similarity {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation{0, 0, 0};
  double scale = 1;

  static Similarity from(const Eigen::Isometry3d& motion) {
    return {Eigen::Quaterniond(motion.linear()).normalized(), motion.translation(), 1};
  }
  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }
  Similarity operator*(const Similarity& other) const {
    return {(rotation * other.rotation).normalized(), *this * other.translation, scale * other.scale};
  }
  Similarity inverse() const {
    const Eigen::Quaterniond back = rotation.conjugate();
    return {back, back * translation * (-1 / scale), 1 / scale};
  }
};

/// The similarity that brings `from` onto `to` with least squares (Umeyama 1991); a rigid motion when `with_scale` is
/// false. Both are of the same size, at least three, not all on a line.
Similarity fit_similarity(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to, bool with_scale);

}  // namespace vantage::tracking
