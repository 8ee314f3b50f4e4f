#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "drivers/camera/frame_source.h"
#include "lcmtypes/link/depth_map.h"
#include "lcmtypes/link/robot_activity.h"
#include "onboard/executive/view_depth.h"

namespace vantage {

/// A view that the planner wants, or a way that somebody drew.
struct ViewGoal {
  std::int64_t planner = 0;  ///< boot id of who asks
  std::int64_t goal_id = 0;
  std::int64_t view_id = -1;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Isometry3d> via = {};  ///< poses to go through first, in order, with a rest at each
  bool expose = true;                       ///< make a depth map there
};

/// What the robot is doing, at one moment.
struct RobotSnapshot {
  RobotActivity activity = RobotActivity::kIdle;  ///< idle, moving or capturing
  std::int64_t planner = 0, goal_id = 0;          ///< of the goal taken up last; 0: none yet, or it was forgotten
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

/// Why the robot's program ends.
struct RobotEnd {
  int exit_status = 0;
  std::string message;
};

/// What moves and sees, as the link knows it: an executive with a carrier, or a camera in somebody's hand. It works in
/// threads of its own; every call returns at once.
class RobotBody {
 public:
  virtual ~RobotBody() = default;

  /// Takes up a goal. False, with the reason in `why`, and nothing changes, when it is none that can be reached.
  virtual bool take_goal(const ViewGoal& goal, std::string* why) = 0;
  /// Stops where the camera is; a goal under way is forgotten, and is in the snapshot no more.
  virtual void hold() = 0;
  virtual RobotSnapshot snapshot() const = 0;
  /// The next finished depth map, each once.
  virtual std::optional<DepthMap> fetch_depth_map() = 0;
  /// The key frame of the latest depth map, each once: for those who want to see it.
  virtual std::optional<Frame> fetch_frame() = 0;
  /// Corrected poses of earlier depth maps, each once.
  virtual std::vector<KeyPose> fetch_corrections() = 0;
  /// When nothing more can come of it: what its program is to end with.
  virtual std::optional<RobotEnd> ended() const = 0;
};

}  // namespace vantage
