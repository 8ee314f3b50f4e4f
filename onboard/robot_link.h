#pragma once

#include <cstdint>
#include <string>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/presence.h"
#include "onboard/executive/executive.h"

namespace vantage {

/// What the robot does when its planner falls silent.
enum class OnLostPlanner {
  kEnd,  ///< the program ends with exit status 3
  kHold  ///< the camera stands still, and takes up goals again when a planner comes back
};

/// Why the robot's program ends.
struct RobotEnd {
  int exit_status = 0;
  std::string message;
};

/// The robot's side of the link: goals in, depth maps and state out, until there is a reason to end.
class RobotLink {
 public:
  /// All must outlive it.
  RobotLink(MessageBus& bus, const Clock& clock, Executive& executive, const std::string& version,
            OnLostPlanner on_lost_planner);

  /// One round: receives for up to a millisecond, sends what is due. True, with `end` filled, when it was the last.
  bool step(RobotEnd* end);

  /// Tells the planner that the robot ends, and why.
  void say_failed(const std::string& message) { presence_.say_failed(message); }

  std::uint64_t refused_goals() const { return refused_goals_; }

 private:
  void on_goal(const motion_goal_t& goal);
  void send_state();
  void send_finished_map();
  bool planner_has_gone(RobotEnd* end);

  MessageBus& bus_;
  const Clock& clock_;
  Executive& executive_;
  OnLostPlanner on_lost_planner_;
  Presence presence_;
  DepthMapSender sender_;
  DecodeCounters decode_;
  std::int64_t session_;
  std::int64_t maps_ = 0;
  std::uint64_t refused_goals_ = 0;
  bool holding_ = false;
  std::chrono::nanoseconds last_state_{0};
};

}  // namespace vantage
