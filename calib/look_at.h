#pragma once

#include <Eigen/Geometry>

namespace vantage {

/// Pose of a camera (x right, y down, z forward) at `eye` that looks at `target`, upright: its x axis is level.
/// Looking straight up or down, x points along the world's -y. `eye` and `target` must differ.
Eigen::Isometry3d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

}  // namespace vantage
