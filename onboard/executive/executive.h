#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Geometry>

#include "drivers/camera/frame_source.h"
#include "drivers/robot/camera_carrier.h"
#include "onboard/executive/free_flight.h"
#include "onboard/executive/robot_body.h"
#include "onboard/executive/view_depth.h"

namespace vantage {

/// Carries the camera to each goal within the speed limits, measures depth there, with the small motion around the view
/// that this may need, and keeps the depth map until it is fetched. Runs in a thread of its own, which alone touches
/// the camera, its carrier and the depth.
///
/// A goal that comes while another is on its way replaces it where the camera is then. A depth map that has not been
/// fetched is never replaced: the thread waits.
class Executive final : public RobotBody {
 public:
  /// `camera` and `carrier` must outlive it. Takes one frame to learn where the camera stands and that its images are
  /// of the rig's size. \throws InputError when there is no frame or it does not fit.
  Executive(FrameSource& camera, CameraCarrier& carrier, ViewDepth& depth, const FlightLimits& limits);
  ~Executive() override;

  bool take_goal(const ViewGoal& goal, std::string* why) override;
  void hold() override;
  RobotSnapshot snapshot() const override;
  std::optional<DepthMap> fetch_depth_map() override;
  std::optional<Frame> fetch_frame() override;
  std::vector<KeyPose> fetch_corrections() override;
  /// When the camera or its carrier has gone.
  std::optional<RobotEnd> ended() const override;

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
