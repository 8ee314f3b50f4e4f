#include "onboard/robot_link.h"

#include <cmath>

#include <gtest/gtest.h>
#include <vantage/motion_goal_t.hpp>
#include <vantage/robot_state_t.hpp>

#include "calib/files/input_error.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/memory_bus.h"
#include "tests/onboard/fake_robot.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

class RobotLinkTest : public testing::Test {
 protected:
  RobotLinkTest() {
    subscribe_message<robot_state_t>(bus_, channel::kRobotState, &decode_,
                                     [this](const robot_state_t& state) { last_state_ = state; });
  }

  motion_goal_t goal(std::int64_t id, double x) {
    motion_goal_t message{};
    message.planner = 77;
    message.goal_id = id;
    message.view_id = 5;
    message.position[0] = x;
    message.quaternion_xyzw[3] = 1;
    return message;
  }

  /// Runs link and planner's presence for a while of simulated time; real time passes as the executive needs it.
  bool run(RobotLink& link, Presence* planner, int rounds, RobotEnd* end) {
    for (int i = 0; i < rounds; ++i) {
      clock_.advance(milliseconds(10));
      if (planner != nullptr) planner->step();
      if (receiver_) receiver_->step();
      if (link.step(end)) return true;
      for (int k = 0; k < 500 && bus_.handle(milliseconds(0)); ++k) {
      }
    }
    return false;
  }

  ManualClock clock_;
  MemoryBus bus_;
  DecodeCounters decode_;
  robot_state_t last_state_{};
  std::vector<depth_map_t> maps_;
  std::unique_ptr<DepthMapReceiver> receiver_;
  FakeRobot robot_;
  StereoDepth depth_{FakeRobot::camera(), FakeRobot::kBaseline_m, {.disparities = 16}};
  Executive executive_{robot_, robot_, depth_, {20, 20}};
};

TEST_F(RobotLinkTest, AGoalBecomesADepthMapOnce) {
  receiver_ =
      std::make_unique<DepthMapReceiver>(bus_, clock_, [this](const depth_map_t& map) { maps_.push_back(map); });
  RobotLink link(bus_, clock_, executive_, "1", OnLostPlanner::kEnd);
  Presence planner(bus_, clock_, Role::kPlanner, "1");
  RobotEnd end;
  publish_message(bus_, channel::kMotionGoal, goal(1, 0.1));
  for (int i = 0; i < 3000 && maps_.empty(); ++i) {
    publish_message(bus_, channel::kMotionGoal, goal(1, 0.1));  // sent until it is taken up
    ASSERT_FALSE(run(link, &planner, 1, &end)) << end.message;
  }
  ASSERT_EQ(maps_.size(), 1u);
  EXPECT_EQ(maps_[0].goal_id, 1);
  EXPECT_EQ(maps_[0].view_id, 5);
  EXPECT_EQ(maps_[0].map_id, 1);
  EXPECT_FALSE(run(link, &planner, 100, &end));
  EXPECT_EQ(maps_.size(), 1u);
  EXPECT_EQ(robot_.exposures(), 2);  // one at the start, one for the goal
  EXPECT_EQ(last_state_.goal_id, 1);
  EXPECT_EQ(last_state_.planner, 77);
}

TEST_F(RobotLinkTest, AGoalWithNanIsRefusedAndCounted) {
  RobotLink link(bus_, clock_, executive_, "1", OnLostPlanner::kEnd);
  RobotEnd end;
  publish_message(bus_, channel::kMotionGoal, goal(1, std::nan("")));
  motion_goal_t unturned = goal(2, 0);
  unturned.quaternion_xyzw[3] = 0;
  publish_message(bus_, channel::kMotionGoal, unturned);
  EXPECT_FALSE(run(link, nullptr, 30, &end));
  EXPECT_EQ(link.refused_goals(), 2u);
  EXPECT_EQ(last_state_.goal_id, 0);
}

TEST_F(RobotLinkTest, ALostPlannerEndsTheProgram) {
  RobotLink link(bus_, clock_, executive_, "1", OnLostPlanner::kEnd);
  Presence planner(bus_, clock_, Role::kPlanner, "1");
  RobotEnd end;
  EXPECT_FALSE(run(link, nullptr, 1000, &end));  // it waits for a first planner without limit
  EXPECT_FALSE(run(link, &planner, 500, &end));
  EXPECT_FALSE(run(link, nullptr, 270, &end));
  ASSERT_TRUE(run(link, nullptr, 40, &end));
  EXPECT_EQ(end.exit_status, kExitPeerLost);
}

TEST_F(RobotLinkTest, OrIsWaitedForInStandstill) {
  RobotLink link(bus_, clock_, executive_, "1", OnLostPlanner::kHold);
  Presence planner(bus_, clock_, Role::kPlanner, "1");
  RobotEnd end;
  EXPECT_FALSE(run(link, &planner, 50, &end));
  EXPECT_FALSE(run(link, nullptr, 1000, &end));
  EXPECT_EQ(executive_.snapshot().activity, Activity::kIdle);
  EXPECT_FALSE(run(link, &planner, 50, &end));
  planner.say_finished("done");
  ASSERT_TRUE(run(link, nullptr, 5, &end));
  EXPECT_EQ(end.exit_status, kExitOk);
  EXPECT_NE(end.message.find("done"), std::string::npos);
}

TEST_F(RobotLinkTest, AVanishedCameraEndsTheProgram) {
  RobotLink link(bus_, clock_, executive_, "1", OnLostPlanner::kHold);
  robot_.vanish("the simulator has gone");
  RobotEnd end;
  bool over = false;
  for (int i = 0; i < 1000 && !over; ++i) over = run(link, nullptr, 1, &end);
  ASSERT_TRUE(over);
  EXPECT_EQ(end.exit_status, kExitPeerLost);
  EXPECT_EQ(end.message, "the simulator has gone");
}

}  // namespace
}  // namespace vantage
