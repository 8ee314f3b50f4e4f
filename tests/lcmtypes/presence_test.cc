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

}  // namespace
}  // namespace vantage
