#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <string>

#include <vantage/motion_goal_t.hpp>
#include <vantage/robot_state_t.hpp>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/presence.h"
#include "offboard/session/session.h"

namespace vantage {

struct PlannerLinkOptions {
  std::chrono::seconds await_robot{30};      ///< for the first sign of a robot
  std::chrono::seconds await_depth_map{60};  ///< from a goal to its depth map
};

/// Why the planner's program ends.
struct PlannerEnd {
  int exit_status = 0;
  std::string message;
};

/// The workstation's side of the link: depth maps in, goals out, until the session is over or the robot has gone.
class PlannerLink {
 public:
  /// All must outlive it.
  PlannerLink(MessageBus& bus, const Clock& clock, Session& session, const std::string& version,
              const PlannerLinkOptions& options = {});

  /// One round: receives for up to a few milliseconds, sends what is due. True, with `end` filled, when it was the
  /// last.
  bool step(PlannerEnd* end);

  void say_finished(const std::string& message) { presence_.say_finished(message); }
  void say_failed(const std::string& message) { presence_.say_failed(message); }

  /// Depth maps that were refused: of a goal that is not the current one, or not valid.
  std::uint64_t refused_maps() const { return refused_maps_; }

 private:
  void on_depth_map(const depth_map_t& map);
  void on_robot_state(const robot_state_t& state);
  void take_waiting_maps();
  void send_goal_when_due();
  bool robot_has_gone(PlannerEnd* end);

  MessageBus& bus_;
  const Clock& clock_;
  Session& session_;
  PlannerLinkOptions options_;
  Presence presence_;
  DepthMapReceiver receiver_;
  DecodeCounters decode_;
  std::deque<depth_map_t> waiting_;
  std::int64_t goal_id_ = 0;  // of the session's current goal; random at the start, so that no old map answers it
  std::int64_t goal_view_ = -1;
  bool goal_taken_up_ = false;
  std::chrono::nanoseconds start_, goal_since_{0}, goal_sent_{0};
  std::uint64_t refused_maps_ = 0;
};

}  // namespace vantage
