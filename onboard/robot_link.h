#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include <vantage/motion_goal_t.hpp>
#include <vantage/preview_t.hpp>
#include <vantage/trajectory_t.hpp>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/command_gate.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/presence.h"
#include "lcmtypes/link/rare_log.h"
#include "lcmtypes/link/status.h"
#include "onboard/executive/robot_body.h"

namespace vantage {

/// What the robot does when its planner falls silent.
enum class OnLostPlanner {
  kEnd,  ///< the program ends with exit status 3
  kHold  ///< the camera stands still, and takes up goals again when a planner comes back
};

struct RobotLinkOptions {
  OnLostPlanner on_lost_planner = OnLostPlanner::kEnd;
  DepthMapSenderOptions sender = {};
  std::function<Status::Counters()> more_counters = {};  ///< of the program, for its status
};

/// The robot's side of the link: commands in, depth maps and state out, until there is a reason to end.
///
/// A stop and a pause hold the camera where it is; goals are refused until a resume. Paused, it still follows
/// trajectories: the planner waits while somebody moves the camera by hand.
class RobotLink {
 public:
  /// All must outlive it. \throws InputError when the spool's folder can't be used.
  RobotLink(MessageBus& bus, const Clock& clock, RobotBody& body, const std::string& version,
            RobotLinkOptions options = {});

  /// One round: receives for up to a millisecond, sends what is due. True, with `end` filled, when it was the last.
  bool step(RobotEnd* end);

  /// Tells the planner that the robot ends, and why.
  void say_finished(const std::string& message) { presence_.say_finished(message); }
  void say_failed(const std::string& message) { presence_.say_failed(message); }

  std::int64_t boot_id() const { return presence_.boot_id(); }
  const CommandGate::Counters& command_counters() const { return gate_.counters(); }
  /// Goals and trajectories in a valid command that could not be taken up: not decodable, no pose, stopped or paused.
  std::uint64_t refused_goals() const { return refused_goals_; }
  const DepthMapSender& sender() const { return sender_; }

 private:
  enum class Halt { kNone, kPaused, kStopped };

  void on_command(const command_t& command);
  void on_goal(const motion_goal_t& goal);
  void on_trajectory(const trajectory_t& trajectory);
  void halt(Halt halt);
  void send_state();
  void send_finished_map();
  void send_key_poses();
  void send_key_pose(std::int64_t map_id);
  void send_preview();
  void tell_of_planner();
  bool body_has_ended(RobotEnd* end);
  bool planner_has_gone(RobotEnd* end);
  Status::Counters counters() const;

  MessageBus& bus_;
  const Clock& clock_;
  RobotBody& body_;
  RobotLinkOptions options_;
  Presence presence_;
  DepthMapSender sender_;
  CommandGate gate_;
  Status status_;
  DecodeCounters commands_, payloads_;
  RareLog refusals_, spool_words_;
  Halt halt_ = Halt::kNone;
  std::optional<preview_t> preview_;  // waits until the line is free
  std::int64_t known_planner_ = 0;
  std::int64_t maps_ = 0;
  std::map<std::int64_t, std::int64_t> map_at_;          // capture time to id, of every map made
  std::map<std::int64_t, Eigen::Isometry3d> key_poses_;  // of maps whose key frame has been moved, by id
  std::int64_t last_key_pose_ = 0;                       // the map that was told of last
  std::chrono::nanoseconds key_pose_sent_{0};
  std::uint64_t refused_goals_ = 0, previews_sent_ = 0;
  bool holding_ = false;
  std::chrono::nanoseconds last_state_{0};
};

}  // namespace vantage
