#include "lcmtypes/link/presence.h"

#include <gtest/gtest.h>

#include "lcmtypes/link/memory_bus.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

class PresenceTest : public testing::Test {
 protected:
  void drain() {
    while (bus_.handle(milliseconds(0))) {
    }
  }
  ManualClock clock_;
  MemoryBus bus_;
  Presence robot_{bus_, clock_, Role::kRobot, "1"};
  Presence planner_{bus_, clock_, Role::kPlanner, "1"};
};

TEST_F(PresenceTest, ASilentPeerIsAwaitedThenKnownThenLost) {
  robot_.step();
  drain();
  EXPECT_EQ(robot_.peer(), PeerPhase::kAwaited);  // its own word does not count
  EXPECT_EQ(planner_.peer(), PeerPhase::kRunning);
  clock_.advance(milliseconds(3000));
  EXPECT_EQ(planner_.peer(), PeerPhase::kRunning);
  clock_.advance(milliseconds(1));
  EXPECT_EQ(planner_.peer(), PeerPhase::kLost);
  robot_.step();
  drain();
  EXPECT_EQ(planner_.peer(), PeerPhase::kRunning);  // it may come back
}

TEST_F(PresenceTest, BeatsFourTimesASecond) {
  DecodeCounters decode;
  int beats = 0;
  subscribe_message<heartbeat_t>(bus_, channel::kHeartbeat, &decode, [&](const heartbeat_t&) { ++beats; });
  for (int t = 0; t < 1000; ++t) {
    robot_.step();
    clock_.advance(milliseconds(1));
  }
  drain();
  EXPECT_EQ(beats, 4);
}

TEST_F(PresenceTest, LastWordsSurviveTheLossOfTwo) {
  int letters = 0;
  bus_.set_fate([&letters](std::string_view) { return ++letters <= 2 ? 0 : 1; });
  planner_.say_finished("twelve views taken");
  drain();
  EXPECT_EQ(robot_.peer(), PeerPhase::kFinished);
  EXPECT_EQ(robot_.peer_message(), "twelve views taken");
  clock_.advance(milliseconds(60'000));
  EXPECT_EQ(robot_.peer(), PeerPhase::kFinished);  // who has finished is not lost
}

TEST_F(PresenceTest, AnotherVersionIsNamedOnBothSides) {
  PresenceOptions later;
  later.link_version = kLinkVersion + 1;
  Presence robot(bus_, clock_, Role::kRobot, "9.1", later);
  robot.step();
  planner_.step();
  drain();
  EXPECT_EQ(planner_.peer(), PeerPhase::kUnfit);
  EXPECT_NE(planner_.peer_message().find("the robot is version 9.1 (link 3), this program version 1 (link 2)"),
            std::string::npos)
      << planner_.peer_message();
  EXPECT_EQ(robot.peer(), PeerPhase::kUnfit);
  EXPECT_NE(robot.peer_message().find("the planner is version 1 (link 2)"), std::string::npos);
}

TEST_F(PresenceTest, ARestartedPeerIsKnownByItsBootId) {
  robot_.step();
  drain();
  EXPECT_EQ(planner_.peer_boot_id(), robot_.boot_id());
  Presence again(bus_, clock_, Role::kRobot, "1");
  again.step();
  drain();
  EXPECT_EQ(planner_.peer_boot_id(), again.boot_id());
  EXPECT_EQ(planner_.peer_restarts(), 1u);
  EXPECT_NE(again.boot_id(), robot_.boot_id());
}

TEST_F(PresenceTest, MeasuresTheClockOnceBothHaveHeardEachOther) {
  robot_.step();
  drain();
  EXPECT_FALSE(planner_.clock_offset());
  planner_.step();
  drain();
  clock_.advance(milliseconds(250));
  robot_.step();
  drain();
  ASSERT_TRUE(planner_.clock_offset());
  EXPECT_EQ(planner_.clock_offset()->offset_us, 0);
  EXPECT_EQ(planner_.peer_utime(), clock_.utime());
}

}  // namespace
}  // namespace vantage
