#include "offboard/planner_link.h"

#include <filesystem>
#include <sstream>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/memory_bus.h"
#include "lcmtypes/link/pose_fields.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

/// A planner with a robot that the test plays, on one bus in simulated time.
class PlannerLinkTest : public testing::Test {
 protected:
  static constexpr milliseconds kRound{50};

  PlannerLinkTest()
      : session_(config(), folder(), true, clock_, terminal_),
        link_(bus_, clock_, session_, "1"),
        robot_(bus_, clock_, Role::kRobot, "1") {
    subscribe_message<command_t>(bus_, channel::kCommand, &decode_, [this](const command_t& command) {
      EXPECT_TRUE(gate_.admit(command, clock_.utime()));
      motion_goal_t goal;
      EXPECT_TRUE(decode_message(command.payload, &goal, &decode_));
      goals_.push_back(goal);
    });
  }
  static SessionConfig config() {
    SessionConfig config;
    config.region = Region::cube({0, 0, 0.6}, 1.28, 0.08);
    config.planning->ray_columns = config.planning->ray_rows = 8;
    config.planning->planner.most_views = 2;
    return config;
  }
  static std::filesystem::path folder() {
    return std::filesystem::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
  }
  bool run(milliseconds duration, bool robot_lives, PlannerEnd* end) {
    for (milliseconds t{0}; t < duration; t += kRound) {
      clock_.advance(kRound);
      if (robot_lives) robot_.step();
      if (link_.step(end)) return true;
      while (bus_.handle(milliseconds(0))) {
      }
    }
    return false;
  }
  void answer(std::int64_t goal_id, std::int64_t map_id) {
    DepthMap map = sample_depth_map(32, 24);
    map.goal_id = goal_id;
    map.map_id = map_id;
    map.view_id = session_.goal()->id;
    map.T_world_camera = session_.goal()->T_world_camera;
    publish_message(bus_, channel::kDepthMap, pack_depth_map(map));
  }

  ManualClock clock_;
  MemoryBus bus_;
  DecodeCounters decode_;
  std::ostringstream terminal_;
  std::vector<motion_goal_t> goals_;
  Session session_;
  PlannerLink link_;
  Presence robot_;
  CommandGate gate_{robot_.boot_id()};
  PlannerEnd end_;
};

TEST_F(PlannerLinkTest, SendsAGoalUntilItIsTakenUp) {
  ASSERT_FALSE(run(milliseconds(2000), true, &end_));
  EXPECT_GE(goals_.size(), 9u);  // every 200 ms
  for (const motion_goal_t& goal : goals_) EXPECT_EQ(goal.goal_id, goals_[0].goal_id);
  robot_state_t state{};
  state.planner = goals_[0].planner;
  state.goal_id = goals_[0].goal_id;
  publish_message(bus_, channel::kRobotState, state);
  ASSERT_FALSE(run(milliseconds(50), true, &end_));
  const std::size_t sent = goals_.size();
  ASSERT_FALSE(run(milliseconds(2000), true, &end_));
  EXPECT_EQ(goals_.size(), sent);
}

TEST_F(PlannerLinkTest, GoesFromMapToMapToTheEnd) {
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  answer(goals_.back().goal_id, 1);
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  EXPECT_EQ(goals_.back().goal_id, goals_.front().goal_id + 1);
  answer(goals_.back().goal_id, 2);
  ASSERT_TRUE(run(milliseconds(500), true, &end_));
  EXPECT_EQ(end_.exit_status, kExitOk);
  EXPECT_EQ(end_.message, "the limit of 2 views is reached");
}

TEST_F(PlannerLinkTest, AMapOfAnotherGoalIsRefusedAndCounted) {
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  answer(goals_.back().goal_id - 1, 1);
  answer(0, 2);
  ASSERT_FALSE(run(milliseconds(100), true, &end_));
  EXPECT_EQ(link_.refused_maps(), 2u);
  EXPECT_EQ(session_.steps(), 0);
}

TEST_F(PlannerLinkTest, ACorrectedKeyFrameGoesToTheSession) {
  EXPECT_FALSE(run(milliseconds(500), true, &end_));
  const Eigen::Isometry3d first_goal = session_.goal()->T_world_camera;
  answer(goals_.back().goal_id, 1);
  EXPECT_FALSE(run(milliseconds(500), true, &end_));
  const auto log_size = [] { return std::filesystem::file_size(folder() / "log.lcm"); };
  key_pose_t pose;
  pose.utime = clock_.utime();
  pose.session = static_cast<std::int64_t>(sample_depth_map(32, 24).session);
  pose.map_id = 1;
  set_pose(first_goal * Eigen::Translation3d(0.01, 0, 0), &pose);
  const std::uint64_t voxels = session_.map().counts().occupied;
  ASSERT_GT(voxels, 0u);
  int logged = 0;
  for (int i = 0; i < 3; ++i) {  // as the robot says it, again and again
    const auto before = log_size();
    publish_message(bus_, channel::kKeyPose, pose);
    while (bus_.handle(milliseconds(0))) {
    }
    logged += log_size() > before;
  }
  EXPECT_EQ(logged, 1);
}

TEST_F(PlannerLinkTest, SaysThatNoRobotIsThere) {
  ASSERT_FALSE(run(milliseconds(29'900), false, &end_));
  ASSERT_TRUE(run(milliseconds(200), false, &end_));
  EXPECT_EQ(end_.exit_status, kExitPeerLost);
  EXPECT_NE(end_.message.find("no robot was heard"), std::string::npos);
  EXPECT_TRUE(goals_.empty());
}

TEST_F(PlannerLinkTest, SaysThatTheRobotHasGone) {
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  ASSERT_TRUE(run(milliseconds(3500), false, &end_));
  EXPECT_EQ(end_.exit_status, kExitPeerLost);
  EXPECT_NE(end_.message.find("no heartbeat"), std::string::npos);
}

TEST_F(PlannerLinkTest, ARobotThatHasFinishedEndsASessionWithoutPlanWell) {
  robot_.say_finished("all images were shown");
  EXPECT_TRUE(run(milliseconds(100), false, &end_));
  EXPECT_EQ(end_.exit_status, kExitPeerLost);  // of a session that plans, it is no good end

  SessionConfig config = PlannerLinkTest::config();
  config.planning.reset();
  Session session(config, folder(), true, clock_, terminal_);
  MemoryBus bus;
  PlannerLink link(bus, clock_, session, "1");
  Presence robot(bus, clock_, Role::kRobot, "1");
  robot.step();
  EXPECT_FALSE(link.step(&end_));
  robot.say_finished("all images were shown");
  bool ended = false;
  for (int i = 0; i < 10 && !ended; ++i) ended = link.step(&end_);  // a message a round
  EXPECT_TRUE(ended);
  EXPECT_EQ(end_.exit_status, kExitOk);
  EXPECT_EQ(end_.message, "the robot has finished: all images were shown");
}

TEST_F(PlannerLinkTest, SaysThatNoDepthMapComes) {
  ASSERT_FALSE(run(milliseconds(59'900), true, &end_));
  ASSERT_TRUE(run(milliseconds(400), true, &end_));
  EXPECT_EQ(end_.exit_status, kExitPeerLost);
  EXPECT_NE(end_.message.find("no depth map of view 0"), std::string::npos);
}

TEST_F(PlannerLinkTest, ARobotThatForgotTheGoalIsToldAgain) {
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  robot_state_t state{};
  state.planner = goals_[0].planner;
  state.goal_id = goals_[0].goal_id;
  publish_message(bus_, channel::kRobotState, state);
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  const std::size_t sent = goals_.size();
  publish_message(bus_, channel::kRobotState, robot_state_t{});  // it was paused, or has started anew
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  ASSERT_GT(goals_.size(), sent);
  EXPECT_EQ(goals_.back().goal_id, goals_.front().goal_id);
}

class ResumedPlannerTest : public PlannerLinkTest, public testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(AnswerComesAtOnce, ResumedPlannerTest, testing::Bool());

TEST_P(ResumedPlannerTest, GoesOnWithTheGoalOfTheOneThatWasKilled) {
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  answer(goals_.back().goal_id, 1);
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  const motion_goal_t asked = goals_.back();
  goals_.clear();
  // Another start of the program, beside the one that is no longer stepped.
  const std::filesystem::path copy = folder().string() + "_resumed";
  std::filesystem::remove_all(copy);
  std::filesystem::copy(folder(), copy, std::filesystem::copy_options::recursive);
  const std::unique_ptr<Session> session = Session::resume(copy, clock_, terminal_);
  EXPECT_EQ(session->steps(), 1);
  EXPECT_EQ(session->goal()->id, session_.goal()->id);
  EXPECT_TRUE(session->map() == session_.map());
  MemoryBus bus;
  PlannerLink link(bus, clock_, *session, "1");
  Presence robot(bus, clock_, Role::kRobot, "1");
  subscribe_message<command_t>(bus, channel::kCommand, &decode_, [this](const command_t& command) {
    motion_goal_t goal;
    EXPECT_TRUE(decode_message(command.payload, &goal, &decode_));
    goals_.push_back(goal);
  });
  const auto step = [&](int rounds) {
    for (int i = 0; i < rounds; ++i) {
      clock_.advance(kRound);
      robot.step();
      if (link.step(&end_)) return true;
      while (bus.handle(milliseconds(0))) {
      }
    }
    return false;
  };
  const bool answered_at_once = GetParam();
  if (!answered_at_once) {
    ASSERT_FALSE(step(10));
    ASSERT_FALSE(goals_.empty());
    EXPECT_EQ(goals_[0].planner, asked.planner);
    EXPECT_EQ(goals_[0].goal_id, asked.goal_id);
    EXPECT_EQ(goals_[0].view_id, asked.view_id);
  }
  // What the robot made for the planner that was killed is taken, also before a word was said.
  DepthMap map = sample_depth_map(32, 24);
  map.goal_id = asked.goal_id;
  map.view_id = asked.view_id;
  map.T_world_camera = session->goal()->T_world_camera;
  publish_message(bus, channel::kDepthMap, pack_depth_map(map));
  ASSERT_TRUE(step(10));
  EXPECT_EQ(end_.message, "the limit of 2 views is reached");
}

TEST_F(PlannerLinkTest, AMapTakenBeforeTheKillIsAcknowledgedNotTakenAgain) {
  ASSERT_FALSE(run(milliseconds(500), true, &end_));
  DepthMapSender sender(bus_, clock_);
  DepthMap map = sample_depth_map(32, 24);
  map.goal_id = goals_.back().goal_id;
  map.view_id = session_.goal()->id;
  map.T_world_camera = session_.goal()->T_world_camera;
  const depth_map_t packed = pack_depth_map(map);
  sender.enqueue(packed);
  for (int i = 0; i < 20 && !sender.idle(); ++i) {
    sender.step();
    ASSERT_FALSE(run(kRound, true, &end_));
  }
  EXPECT_TRUE(sender.idle());
  EXPECT_EQ(session_.steps(), 1);
  const std::filesystem::path copy = folder().string() + "_resumed";
  std::filesystem::remove_all(copy);
  std::filesystem::copy(folder(), copy, std::filesystem::copy_options::recursive);
  const std::unique_ptr<Session> session = Session::resume(copy, clock_, terminal_);
  MemoryBus bus;
  PlannerLink link(bus, clock_, *session, "1");
  DepthMapSender again(bus, clock_);
  again.enqueue(packed);
  for (int i = 0; i < 20 && !again.idle(); ++i) {
    clock_.advance(kRound);
    again.step();
    ASSERT_FALSE(link.step(&end_));
  }
  EXPECT_TRUE(again.idle());
  EXPECT_EQ(session->steps(), 1);
  EXPECT_EQ(link.refused_maps(), 0u);
}

TEST_F(PlannerLinkTest, ARobotOfAnotherVersionIsNamed) {
  PresenceOptions later;
  later.link_version = kLinkVersion + 1;
  Presence robot(bus_, clock_, Role::kRobot, "9", later);
  robot.step();
  ASSERT_TRUE(run(milliseconds(500), false, &end_));
  EXPECT_EQ(end_.exit_status, kExitPeerLost);
  EXPECT_NE(end_.message.find("the robot is version 9 (link 3)"), std::string::npos) << end_.message;
}

}  // namespace
}  // namespace vantage
