#include "lcmtypes/link/command_gate.h"

#include <algorithm>

namespace vantage {

bool CommandGate::admit(const command_t& command, std::int64_t now) {
  const auto refuse = [](std::uint64_t* reason) {
    ++*reason;
    return false;
  };
  const bool carries = command.kind == static_cast<std::int8_t>(CommandKind::kGoal) ||
                       command.kind == static_cast<std::int8_t>(CommandKind::kTrajectory);
  if (command.kind < static_cast<std::int8_t>(CommandKind::kGoal) ||
      command.kind > static_cast<std::int8_t>(CommandKind::kTrajectory) || carries == command.payload.empty()) {
    return refuse(&counters_.unknown_kind);
  }
  if (command.kind == static_cast<std::int8_t>(CommandKind::kStop)) {
    if (command.robot == robot_) counter_ = std::max(counter_, command.counter);
    ++counters_.accepted;
    return true;
  }
  constexpr std::int64_t kLongest_us = std::chrono::microseconds(kLongestCommandLife).count();
  if (command.robot != robot_) return refuse(&counters_.other_robot);
  if (command.counter <= counter_) return refuse(&counters_.not_rising);
  if (command.expires <= now) return refuse(&counters_.expired);
  if (command.expires - now > kLongest_us) return refuse(&counters_.too_long);
  counter_ = command.counter;
  ++counters_.accepted;
  return true;
}

}  // namespace vantage
