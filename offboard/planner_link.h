#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

#include <vantage/motion_goal_t.hpp>
#include <vantage/robot_state_t.hpp>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/command_sender.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/presence.h"
#include "lcmtypes/link/rare_log.h"
#include "lcmtypes/link/status.h"
#include "offboard/session/session.h"

namespace vantage {

/// What the planner does when its robot falls silent.
enum class OnLostRobot {
  kEnd,  ///< the program ends with exit status 3
  kWait  ///< it waits for the robot's next start, and goes on with the goal it had
};

struct PlannerLinkOptions {
  OnLostRobot on_lost_robot = OnLostRobot::kEnd;
  std::chrono::seconds await_robot{30};                  ///< for the first sign of a robot
  std::chrono::seconds await_depth_map{60};              ///< from a goal to its depth map
  std::function<Status::Counters()> more_counters = {};  ///< of the program, for its status
};

/// Why the planner's program ends.
struct PlannerEnd {
  int exit_status = 0;
  std::string message;
};

/// The workstation's side of the link: depth maps in, goals out, until the session is over or the robot has gone.
///
/// A depth map is acknowledged when the session has taken it, its log included: what the robot gives up for delivered
/// outlives this program.
class PlannerLink {
 public:
  /// All must outlive it.
  PlannerLink(MessageBus& bus, const Clock& clock, Session& session, const std::string& version,
              const PlannerLinkOptions& options = {});

  /// One round: receives for up to a few milliseconds, sends what is due. True, with `end` filled, when it was the
  /// last.
  bool step(PlannerEnd* end);

  /// The last words, to the robot; the last counters, to the log.
  void say_finished(const std::string& message);
  void say_failed(const std::string& message) { presence_.say_failed(message); }

  /// Depth maps that were refused: of a goal that is not the current one, or not valid.
  std::uint64_t refused_maps() const { return refused_maps_; }
  const DepthMapReceiver& receiver() const { return receiver_; }

 private:
  void on_depth_map(const depth_map_t& map);
  void on_robot_state(const robot_state_t& state);
  void set_goal();
  void send_goal_when_due();
  void tell_of_robot();
  bool robot_has_gone(PlannerEnd* end);
  Status::Counters counters() const;

  MessageBus& bus_;
  const Clock& clock_;
  Session& session_;
  PlannerLinkOptions options_;
  Presence presence_;
  CommandSender commands_;
  DepthMapReceiver receiver_;
  Status status_;
  DecodeCounters states_, statuses_, previews_, key_poses_;
  RareLog refusals_, waiting_words_;
  motion_goal_t goal_;  // the session's current one
  bool goal_set_ = false;
  bool goal_taken_up_ = false;
  std::int64_t known_robot_ = 0;
  std::chrono::nanoseconds start_, goal_since_{0}, goal_sent_{0};
  std::uint64_t refused_maps_ = 0, moved_maps_ = 0, goals_sent_ = 0;
};

}  // namespace vantage
