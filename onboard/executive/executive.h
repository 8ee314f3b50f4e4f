#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Geometry>

#include "drivers/camera/frame_source.h"
#include "drivers/robot/camera_carrier.h"
#include "lcmtypes/link/depth_map.h"
#include "lcmtypes/link/robot_activity.h"
#include "onboard/executive/free_flight.h"
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

/// Carries the camera to each goal within the speed limits, measures depth there, with the small motion around the view
/// that this may need, and keeps the depth map until it is fetched. Runs in a thread of its own, which alone touches
/// the camera, its carrier and the depth.
///
/// A goal that comes while another is on its way replaces it where the camera is then. A depth map that has not been
/// fetched is never replaced: the thread waits.
class Executive {
 public:
  /// `camera` and `carrier` must outlive it. Takes one frame to learn where the camera stands and that its images are
  /// of the rig's size. \throws InputError when there is no frame or it does not fit.
  Executive(FrameSource& camera, CameraCarrier& carrier, ViewDepth& depth, const FlightLimits& limits);
  ~Executive();

  /// Takes up a goal. False, and nothing changes, when one of its poses is not rigid.
  bool take_goal(const ViewGoal& goal);
  /// Stops where the camera is; a goal under way is forgotten, and is in the snapshot no more.
  void hold();
  RobotSnapshot snapshot() const;
  /// The next finished depth map, each once.
  std::optional<DepthMap> fetch_depth_map();
  /// The key frame of the latest depth map, each once: for those who want to see it.
  std::optional<Frame> fetch_frame();
  /// Corrected poses of earlier depth maps, each once.
  std::vector<KeyPose> fetch_corrections();
  /// True, with the reason, when the camera or its carrier has gone: no goal will be reached any more.
  bool ended(std::string* reason) const;

 private:
  void run();
  enum class Watch { kNo, kWay };
  bool fly(const Eigen::Isometry3d& to, Watch watch);
  bool follow(const ViewGoal& goal);
  void arrive();
  bool expose(Frame* frame);
  bool measure(const ViewGoal& goal);
  void note_corrections();
  bool superseded() const;
  void end(const std::string& reason);

  FrameSource& camera_;
  CameraCarrier& carrier_;
  ViewDepth& depth_;
  FlightLimits limits_;

  mutable std::mutex mutex_;  // guards everything below but the thread
  std::condition_variable changed_;
  std::optional<ViewGoal> next_goal_;
  std::optional<DepthMap> finished_;
  std::optional<Frame> frame_;
  std::vector<KeyPose> corrections_;
  RobotSnapshot snapshot_;
  std::string end_reason_;
  bool hold_ = false, stop_ = false;
  bool goal_reached_ = false;  // the camera is there, and has exposed if it was to

  std::thread thread_;
};

}  // namespace vantage
