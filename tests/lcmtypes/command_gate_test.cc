#include "lcmtypes/link/command_gate.h"

#include <gtest/gtest.h>
#include <vantage/motion_goal_t.hpp>

#include "lcmtypes/link/command_sender.h"
#include "lcmtypes/link/memory_bus.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

constexpr std::int64_t kRobot = 11, kNow = 1'000'000'000;

command_t command(CommandKind kind, std::int64_t counter) {
  command_t command{};
  command.robot = kRobot;
  command.counter = counter;
  command.expires = kNow + 1;
  command.kind = static_cast<std::int8_t>(kind);
  if (kind == CommandKind::kGoal) command.payload = {1};
  command.size = static_cast<std::int32_t>(command.payload.size());
  return command;
}

TEST(CommandGate, EachCounterIsObeyedOnceAndOnlyAboveTheLast) {
  CommandGate gate(kRobot);
  EXPECT_TRUE(gate.admit(command(CommandKind::kGoal, 5), kNow));
  EXPECT_FALSE(gate.admit(command(CommandKind::kGoal, 5), kNow));
  EXPECT_FALSE(gate.admit(command(CommandKind::kPause, 4), kNow));
  EXPECT_TRUE(gate.admit(command(CommandKind::kPause, 6), kNow));
  EXPECT_EQ(gate.counter(), 6);
  EXPECT_EQ(gate.counters().not_rising, 2u);
  EXPECT_EQ(gate.counters().accepted, 2u);
}

TEST(CommandGate, AnExpiredOneIsRefusedAndSoIsOneThatNeverExpires) {
  CommandGate gate(kRobot);
  EXPECT_FALSE(gate.admit(command(CommandKind::kGoal, 1), kNow + 1));
  EXPECT_EQ(gate.counters().expired, 1u);
  EXPECT_FALSE(gate.admit(command(CommandKind::kGoal, 1), kNow - 10'000'000));
  EXPECT_EQ(gate.counters().too_long, 1u);
  EXPECT_TRUE(gate.admit(command(CommandKind::kGoal, 1), kNow));
}

TEST(CommandGate, OneForAnotherStartOfTheRobotIsRefused) {
  CommandGate gate(kRobot + 1);
  EXPECT_FALSE(gate.admit(command(CommandKind::kResume, 1), kNow));
  EXPECT_EQ(gate.counters().other_robot, 1u);
  EXPECT_EQ(gate.counter(), 0);
}

TEST(CommandGate, AStopIsObeyedAtAnyTime) {
  CommandGate gate(kRobot);
  EXPECT_TRUE(gate.admit(command(CommandKind::kGoal, 9), kNow));
  command_t stop = command(CommandKind::kStop, 3);
  EXPECT_TRUE(gate.admit(stop, kNow + 100'000'000));
  EXPECT_EQ(gate.counter(), 9);  // what came before stays used
  stop.robot = 0;
  EXPECT_TRUE(gate.admit(stop, kNow));
  stop.robot = kRobot;
  stop.counter = 20;
  EXPECT_TRUE(gate.admit(stop, kNow));
  EXPECT_FALSE(gate.admit(command(CommandKind::kGoal, 15), kNow));  // said before the stop
}

TEST(CommandGate, WhatIsNoCommandIsRefused) {
  CommandGate gate(kRobot);
  for (const int kind : {-1, 5, 127}) {
    command_t strange = command(CommandKind::kPause, 1);
    strange.kind = static_cast<std::int8_t>(kind);
    EXPECT_FALSE(gate.admit(strange, kNow));
  }
  command_t loaded = command(CommandKind::kStop, 1);
  loaded.payload = {1};
  EXPECT_FALSE(gate.admit(loaded, kNow));
  command_t empty = command(CommandKind::kGoal, 1);
  empty.payload.clear();
  EXPECT_FALSE(gate.admit(empty, kNow));
  EXPECT_EQ(gate.counters().unknown_kind, 5u);
}

class CommandWay : public testing::Test {
 protected:
  /// The robot's clock is one hour ahead of the planner's.
  class AheadClock final : public Clock {
   public:
    explicit AheadClock(const Clock& base) : base_(base) {}
    std::chrono::nanoseconds monotonic() const override { return base_.monotonic() + std::chrono::seconds(5); }
    std::int64_t utime() const override { return base_.utime() + 3'600'000'000; }

   private:
    const Clock& base_;
  };

  CommandWay() {
    subscribe_message<command_t>(bus_, channel::kCommand, &decode_,
                                 [this](const command_t& c) { admitted_ += gate_.admit(c, robot_clock_.utime()); });
  }
  void drain() {
    while (bus_.handle(milliseconds(0))) {
    }
  }

  ManualClock clock_;
  AheadClock robot_clock_{clock_};
  MemoryBus bus_;
  DecodeCounters decode_;
  Presence robot_{bus_, robot_clock_, Role::kRobot, "1"};
  Presence planner_{bus_, clock_, Role::kPlanner, "1"};
  CommandGate gate_{robot_.boot_id()};
  CommandSender sender_{bus_, clock_, planner_};
  int admitted_ = 0;
};

TEST_F(CommandWay, ReachesARobotWhoseClockIsAnother) {
  EXPECT_FALSE(sender_.send(CommandKind::kPause));  // no robot heard yet
  robot_.step();
  drain();
  clock_.advance(milliseconds(200));
  EXPECT_TRUE(sender_.send(CommandKind::kPause));
  EXPECT_TRUE(sender_.send(CommandKind::kResume));
  drain();
  EXPECT_EQ(admitted_, 2);
}

TEST_F(CommandWay, ACommandHeldBackExpires) {
  robot_.step();
  drain();
  EXPECT_TRUE(sender_.send(CommandKind::kPause));
  clock_.advance(milliseconds(2100));
  drain();
  EXPECT_EQ(admitted_, 0);
  EXPECT_EQ(gate_.counters().expired, 1u);
}

TEST_F(CommandWay, ANewPlannerGoesOnWhereTheLastOneEnded) {
  robot_.step();
  drain();
  for (int i = 0; i < 5; ++i) sender_.send(CommandKind::kPause);
  drain();
  ASSERT_EQ(admitted_, 5);
  robot_.set_command_counter(gate_.counter());
  Presence second(bus_, clock_, Role::kPlanner, "1");
  CommandSender next(bus_, clock_, second);
  clock_.advance(milliseconds(250));
  robot_.step();
  drain();
  EXPECT_TRUE(next.send(CommandKind::kPause));
  drain();
  EXPECT_EQ(admitted_, 6);
}

TEST_F(CommandWay, AStopNeedsNobodyHeard) {
  EXPECT_TRUE(sender_.send(CommandKind::kStop));
  drain();
  EXPECT_EQ(admitted_, 1);
}

}  // namespace
}  // namespace vantage
