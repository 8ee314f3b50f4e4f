#include "lcmtypes/link/command_sender.h"

#include <algorithm>

namespace vantage {
namespace {

/// Longer than a datagram is under way, shorter than a lost link goes unnoticed. Commands are sent again with a new
/// one.
constexpr std::int64_t kLife_us = 2'000'000;

}  // namespace

CommandSender::CommandSender(MessageBus& bus, const Clock& clock, const Presence& robot)
    : bus_(bus), clock_(clock), robot_(robot) {}

bool CommandSender::send(CommandKind kind, std::span<const std::uint8_t> payload) {
  const std::optional<std::int64_t> robot_now = robot_.peer_utime();
  if (!robot_now && kind != CommandKind::kStop) return false;
  if (counter_robot_ != robot_.peer_boot_id()) {
    counter_robot_ = robot_.peer_boot_id();
    counter_ = 0;
  }
  counter_ = std::max(counter_, robot_.peer_command_counter()) + 1;
  command_t command;
  command.utime = clock_.utime();
  command.sender = robot_.boot_id();
  command.robot = robot_.peer_boot_id();
  command.counter = counter_;
  command.expires = robot_now.value_or(0) + kLife_us;
  command.kind = static_cast<std::int8_t>(kind);
  command.size = static_cast<std::int32_t>(payload.size());
  command.payload.assign(payload.begin(), payload.end());
  publish_message(bus_, channel::kCommand, command);
  return true;
}

}  // namespace vantage
