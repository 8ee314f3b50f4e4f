#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>
#include <vantage/trajectory_t.hpp>

namespace vantage {

/// More would not fit one datagram.
inline constexpr std::size_t kMostWaypoints = 1000;

/// The poses T_world_camera of a trajectory, in order. Nothing when their numbers do not come in sevens, one is not
/// finite, a quaternion is not of unit length (to 1e-6), or there are more than kMostWaypoints.
std::optional<std::vector<Eigen::Isometry3d>> waypoints_of(const trajectory_t& trajectory);

/// \pre at most kMostWaypoints rigid poses
void set_waypoints(const std::vector<Eigen::Isometry3d>& poses, trajectory_t* trajectory);

}  // namespace vantage
