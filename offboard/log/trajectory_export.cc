#include "offboard/log/trajectory_export.h"

#include <map>
#include <vector>

#include "calib/files/input_error.h"
#include "calib/files/trajectory.h"
#include "offboard/log/known_channels.h"
#include "offboard/log/log_maps.h"
#include "offboard/log/log_scan.h"
#include "offboard/log/message_pose.h"

namespace vantage {

TrajectoryExport export_trajectory(const std::filesystem::path& log, PoseSource source,
                                   const std::filesystem::path& file) {
  TrajectoryExport result;
  std::map<std::int64_t, Eigen::Isometry3d> poses;  // by their time, us
  const auto add = [&](std::int64_t utime, const Eigen::Isometry3d& pose) {
    if (!poses.emplace(utime, pose).second) ++result.left_out;
  };
  if (source == PoseSource::kDepthMaps) {
    for_each_depth_map(log, [&](const DepthMap& map) { add(map.utime, map.T_world_camera); });
  } else {
    scan_whole_log(log, [&](const LogEvent& event) {
      const ChannelSchema* schema = find_channel(event.channel);
      if (schema == nullptr || schema->type != "robot_state_t") return;
      std::string why;
      const std::optional<MessageFields> state = MessageFields::read(*schema, event.bytes, &why);
      const std::optional<Eigen::Isometry3d> pose = state ? pose_in(*state) : std::nullopt;
      if (pose) {
        add(state->find("utime")->integer(), *pose);
      } else {
        ++result.left_out;
      }
    });
  }
  if (poses.empty()) {
    throw InputError(log.string() + (source == PoseSource::kDepthMaps
                                         ? ": holds no depth map; --tum-from states takes the robot's states"
                                         : ": holds no robot state; --tum-from maps takes the depth maps' poses"));
  }
  std::vector<StampedPose> trajectory;
  for (const auto& [utime, pose] : poses) trajectory.push_back({static_cast<double>(utime) * 1e-6, pose});
  write_tum_trajectory(file, trajectory);
  result.poses = static_cast<std::int64_t>(trajectory.size());
  return result;
}

}  // namespace vantage
