#pragma once

#include <cstdint>
#include <span>

#include "lcmtypes/link/command_gate.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/presence.h"

namespace vantage {

/// Tells the robot what to do, in a form that its CommandGate admits.
class CommandSender {
 public:
  /// Both must outlive it. `robot`: the presence that hears the robot.
  CommandSender(MessageBus& bus, const Clock& clock, const Presence& robot);

  /// Sends once; datagrams get lost, so send again until the robot's state shows it. False, and nothing goes out, while
  /// no robot has been heard; a stop goes out all the same. `payload`: the encoded motion_goal_t
  /// or trajectory_t of those kinds.
  bool send(CommandKind kind, std::span<const std::uint8_t> payload = {});

 private:
  MessageBus& bus_;
  const Clock& clock_;
  const Presence& robot_;
  std::int64_t counter_ = 0, counter_robot_ = 0;
};

}  // namespace vantage
