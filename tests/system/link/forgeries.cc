// Commands that must not be obeyed.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <map>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <vantage/motion_goal_t.hpp>
#include <vantage/robot_state_t.hpp>
#include <vantage/status_t.hpp>

#include "calib/files/input_error.h"
#include "lcmtypes/link/command_gate.h"
#include "lcmtypes/link/lcm_bus.h"
#include "lcmtypes/link/presence.h"
#include "lcmtypes/link/sealed_bus.h"
#include "tests/system/link/link_faults.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using Bytes = std::vector<std::uint8_t>;

/// The latest status and state of the robot, as anyone with the key hears them.
class RobotWatch {
 public:
  RobotWatch(MessageBus& bus, const Clock& clock) : presence_(bus, clock, Role::kPlanner, "watch") {
    subscribe_message<status_t>(bus, channel::kStatus, &decode_, [this](const status_t& status) {
      if (status.role != static_cast<std::int8_t>(Role::kRobot)) return;
      for (std::size_t i = 0; i < status.name.size(); ++i) counters_[status.name[i]] = status.value[i];
      ++statuses_;
    });
    subscribe_message<robot_state_t>(bus, channel::kRobotState, &decode_, [this](const robot_state_t& state) {
      states_.insert({state.goal_id, state.activity});
    });
  }
  const Presence& presence() const { return presence_; }
  std::int64_t counter(const std::string& name) const {
    const auto found = counters_.find(name);
    return found == counters_.end() ? 0 : found->second;
  }
  int statuses() const { return statuses_; }
  /// Every pair of goal and activity that was seen since the last call.
  std::set<std::pair<std::int64_t, int>> take_states() { return std::exchange(states_, {}); }

 private:
  Presence presence_;
  DecodeCounters decode_;
  std::map<std::string, std::int64_t> counters_;
  std::set<std::pair<std::int64_t, int>> states_;
  int statuses_ = 0;
};

void listen(MessageBus& bus, milliseconds duration) {
  const auto end = std::chrono::steady_clock::now() + duration;
  while (std::chrono::steady_clock::now() < end) bus.handle(milliseconds(5));
}

/// Lets what goes through pass on as it is, and keeps a copy.
Bytes sealed_as(const LinkKey& key, const char* channel, const Bytes& bytes) {
  class Keeper final : public MessageBus {
   public:
    void publish(std::string_view, std::span<const std::uint8_t> b) override { kept.assign(b.begin(), b.end()); }
    void subscribe(std::string_view, Handler) override {}
    bool handle(milliseconds) override { return false; }
    Bytes kept;
  } keeper;
  SealedBus(keeper, {key}).publish(channel, bytes);
  return keeper.kept;
}

Bytes command_bytes(std::int64_t robot, std::int64_t counter, std::int64_t expires, const Bytes& goal) {
  command_t command{};
  command.robot = robot;
  command.counter = counter;
  command.expires = expires;
  command.size = static_cast<std::int32_t>(goal.size());
  command.payload = goal;
  return encode_message(command);
}

}  // namespace

int forge_commands(const FaultArguments& arguments) {
  const LinkKey key = read_link_key(arguments.key);
  const SystemClock clock;
  LcmBus lcm;
  SealedBus bus(lcm, {key});
  RobotWatch robot(bus, clock);
  std::vector<Bytes> captured;
  auto last_command = std::chrono::steady_clock::now();
  lcm.subscribe(channel::kCommand, [&](std::span<const std::uint8_t> bytes) {
    captured.emplace_back(bytes.begin(), bytes.end());
    last_command = std::chrono::steady_clock::now();
  });
  // The planner speaks, and is gone: what comes after is ours.
  const auto begin = std::chrono::steady_clock::now();
  while (captured.size() < 2 || std::chrono::steady_clock::now() - last_command < std::chrono::seconds(3)) {
    bus.handle(milliseconds(20));
    if (std::chrono::steady_clock::now() - begin > std::chrono::seconds(60)) {
      throw InputError("no planner commanded within 60 s, or it goes on");
    }
  }
  const std::vector<Bytes> genuine = std::exchange(captured, {});
  listen(bus, milliseconds(2500));
  robot.take_states();
  const std::int64_t accepted = robot.counter("commands.accepted");
  const auto refused = [&] {
    return robot.counter("commands.not_rising") + robot.counter("commands.expired") +
           robot.counter("commands.other_robot") + robot.counter("commands.too_long") +
           robot.counter("commands.unknown_kind") + robot.counter("seals.refused") +
           robot.counter("door.commands.wrong_type") + robot.counter("door.commands.wrong_size");
  };
  const std::int64_t refused_before = refused();
  const std::int64_t boot_id = robot.presence().peer_boot_id();

  command_t last;
  DecodeCounters decode;
  const Bytes& newest = genuine.back();
  if (!decode_message(std::span(newest).first(newest.size() - SealedBus::kSealBytes), &last, &decode)) {
    throw InputError("the captured command does not decode");
  }
  motion_goal_t goal;
  if (!decode_message(last.payload, &goal, &decode)) throw InputError("the captured goal does not decode");
  goal.goal_id += 1000;
  const Bytes goal_bytes = encode_message(goal);
  std::mt19937 random(arguments.seed);
  const LinkKey foreign = make_link_key();
  const std::array<const char*, 9> names = {
      "replayed",           "one bit changed", "foreign key",       "no seal",       "sealed for another channel",
      "counter not rising", "expired",         "for another start", "valid too long"};
  std::array<int, 9> sent{};
  for (int i = 0; i < arguments.count; ++i) {
    const std::int64_t soon = *robot.presence().peer_utime() + 1'000'000;
    const std::int64_t next = last.counter + 1 + i;
    const auto kind = static_cast<std::size_t>(i) % names.size();
    Bytes bytes = genuine[random() % genuine.size()];
    switch (kind) {
      case 0:
        break;
      case 1:
        bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1u << random() % 8);
        break;
      case 2:
        bytes = sealed_as(foreign, channel::kCommand, command_bytes(boot_id, next, soon, goal_bytes));
        break;
      case 3:
        bytes = command_bytes(boot_id, next, soon, goal_bytes);
        break;
      case 4:
        bytes = sealed_as(key, channel::kRobotState, command_bytes(boot_id, next, soon, goal_bytes));
        break;
      case 5:
        bytes = sealed_as(key, channel::kCommand, command_bytes(boot_id, last.counter, soon, goal_bytes));
        break;
      case 6:
        bytes = sealed_as(key, channel::kCommand, command_bytes(boot_id, next, soon - 2'000'000, goal_bytes));
        break;
      case 7:
        bytes = sealed_as(key, channel::kCommand, command_bytes(boot_id ^ 1, next, soon, goal_bytes));
        break;
      case 8:
        bytes = sealed_as(key, channel::kCommand, command_bytes(boot_id, next, soon + 60'000'000, goal_bytes));
        break;
    }
    lcm.publish(channel::kCommand, bytes);
    ++sent[kind];
    while (bus.handle(milliseconds(0))) {
    }
    if (i % 16 == 0) std::this_thread::sleep_for(milliseconds(2));  // so that none is lost on the way
  }
  listen(bus, milliseconds(2500));
  const std::int64_t newly_accepted = robot.counter("commands.accepted") - accepted;
  const std::int64_t newly_refused = refused() - refused_before;
  const auto states = robot.take_states();
  std::printf("forgeries %d:", arguments.count);
  for (std::size_t i = 0; i < names.size(); ++i) std::printf("%s %d %s", i == 0 ? "" : ",", sent[i], names[i]);
  std::printf("; refused %lld, accepted %lld\n", static_cast<long long>(newly_refused),
              static_cast<long long>(newly_accepted));
  const bool moved = std::any_of(states.begin(), states.end(),
                                 [&](const auto& state) { return state.first == goal.goal_id || state.second == 1; });
  if (moved) std::printf("the robot MOVED\n");
  const bool arrived = newly_refused >= arguments.count * 99LL / 100;
  if (!arrived) std::printf("too few arrived to tell\n");
  return newly_accepted == 0 && !moved && arrived ? kExitOk : kExitFailure;
}

}  // namespace vantage
