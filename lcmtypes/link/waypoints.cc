#include "lcmtypes/link/waypoints.h"

#include <algorithm>

#include "lcmtypes/link/pose_fields.h"

namespace vantage {
namespace {

constexpr std::size_t kNumbers = 7;  // of a waypoint

struct PoseFields {
  double position[3];
  double quaternion_xyzw[4];
};

}  // namespace

std::optional<std::vector<Eigen::Isometry3d>> waypoints_of(const trajectory_t& trajectory) {
  const std::vector<double>& numbers = trajectory.waypoint;
  if (numbers.size() % kNumbers != 0 || numbers.size() / kNumbers > kMostWaypoints) return std::nullopt;
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t i = 0; i < numbers.size(); i += kNumbers) {
    PoseFields fields;
    std::copy_n(numbers.data() + i, 3, fields.position);
    std::copy_n(numbers.data() + i + 3, 4, fields.quaternion_xyzw);
    const std::optional<Eigen::Isometry3d> pose = pose_of(fields);
    if (!pose) return std::nullopt;
    poses.push_back(*pose);
  }
  return poses;
}

void set_waypoints(const std::vector<Eigen::Isometry3d>& poses, trajectory_t* trajectory) {
  trajectory->waypoint.clear();
  for (const Eigen::Isometry3d& pose : poses) {
    PoseFields fields;
    set_pose(pose, &fields);
    trajectory->waypoint.insert(trajectory->waypoint.end(), fields.position, fields.position + 3);
    trajectory->waypoint.insert(trajectory->waypoint.end(), fields.quaternion_xyzw, fields.quaternion_xyzw + 4);
  }
  trajectory->numbers = static_cast<std::int32_t>(trajectory->waypoint.size());
}

}  // namespace vantage
