#include "onboard/robot_link.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <gtest/gtest.h>
#include <vantage/key_pose_t.hpp>
#include <vantage/motion_goal_t.hpp>
#include <vantage/robot_state_t.hpp>

#include "calib/files/input_error.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/memory_bus.h"
#include "lcmtypes/link/waypoints.h"
#include "onboard/executive/executive.h"
#include "onboard/executive/stereo_view.h"
#include "tests/onboard/fake_robot.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

/// A stereo pair whose first key frame turns out to stand 1 cm higher, as soon as the second is measured.
class LateCorrection final : public ViewDepth {
 public:
  explicit LateCorrection(StereoDepth& matcher) : stereo_(matcher) {}
  bool fits(const Frame& frame, std::string* why) override { return stereo_.fits(frame, why); }
  bool watches_the_way() const override { return false; }
  void pass(const Frame&) override {}
  void begin(const Frame& key) override { stereo_.begin(key); }
  std::optional<Eigen::Isometry3d> next_pose() override { return {}; }
  void add(const Frame&) override {}
  bool finish(DepthMap* map, std::string* why) override {
    if (!stereo_.finish(map, why)) return false;
    if (!first_) first_ = KeyPose{map->utime, map->T_world_camera * Eigen::Translation3d(0, 0, 0.01)};
    ++measured_;
    return true;
  }
  std::vector<KeyPose> corrections() override {
    if (measured_ < 1 || std::exchange(told_, true)) return {};
    return {*first_};
  }

 private:
  StereoView stereo_;
  std::optional<KeyPose> first_;
  int measured_ = 0;
  bool told_ = false;
};

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

  /// As a planner would say it.
  void send(const RobotLink& link, CommandKind kind, std::span<const std::uint8_t> payload = {}) {
    command_t command{};
    command.robot = link.boot_id();
    command.counter = ++counter_;
    command.expires = clock_.utime() + 1'000'000;
    command.kind = static_cast<std::int8_t>(kind);
    command.size = static_cast<std::int32_t>(payload.size());
    command.payload.assign(payload.begin(), payload.end());
    publish_message(bus_, channel::kCommand, command);
  }
  void send(const RobotLink& link, const motion_goal_t& goal) { send(link, CommandKind::kGoal, encode_message(goal)); }

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
  std::int64_t counter_ = 0;
  robot_state_t last_state_{};
  std::vector<depth_map_t> maps_;
  std::unique_ptr<DepthMapReceiver> receiver_;
  FakeRobot robot_;
  StereoDepth matcher_{FakeRobot::camera(), FakeRobot::kBaseline_m, {.disparities = 16}};
  StereoView depth_{matcher_};
  Executive executive_{robot_, robot_, depth_, {20, 20}};
};

TEST_F(RobotLinkTest, AGoalBecomesADepthMapOnce) {
  receiver_ =
      std::make_unique<DepthMapReceiver>(bus_, clock_, [this](const depth_map_t& map) { maps_.push_back(map); });
  RobotLink link(bus_, clock_, executive_, "1", {.on_lost_planner = OnLostPlanner::kEnd});
  Presence planner(bus_, clock_, Role::kPlanner, "1");
  RobotEnd end;
  send(link, goal(1, 0.1));
  for (int i = 0; i < 3000 && maps_.empty(); ++i) {
    send(link, goal(1, 0.1));  // sent until it is taken up
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

TEST_F(RobotLinkTest, AKeyFrameThatWasMovedIsToldAgainAndAgain) {
  LateCorrection depth(matcher_);
  Executive executive(robot_, robot_, depth, {20, 20});
  receiver_ =
      std::make_unique<DepthMapReceiver>(bus_, clock_, [this](const depth_map_t& map) { maps_.push_back(map); });
  std::vector<key_pose_t> told;
  subscribe_message<key_pose_t>(bus_, channel::kKeyPose, &decode_, [&](const key_pose_t& p) { told.push_back(p); });
  RobotLink link(bus_, clock_, executive, "1", {.on_lost_planner = OnLostPlanner::kEnd});
  Presence planner(bus_, clock_, Role::kPlanner, "1");
  RobotEnd end;
  for (const std::int64_t id : {1, 2}) {
    for (int i = 0; i < 3000 && maps_.size() < static_cast<std::size_t>(id); ++i) {
      send(link, goal(id, 0.1 * static_cast<double>(id)));
      ASSERT_FALSE(run(link, &planner, 1, &end)) << end.message;
    }
    if (id == 1) {
      EXPECT_TRUE(told.empty());
    }
  }
  ASSERT_EQ(maps_.size(), 2u);
  EXPECT_FALSE(run(link, &planner, 100, &end));  // a second
  ASSERT_GE(told.size(), 4u);
  EXPECT_LE(told.size(), 12u);
  for (const key_pose_t& pose : told) {
    EXPECT_EQ(pose.map_id, 1);
    EXPECT_EQ(pose.session, maps_[0].session);
    EXPECT_NEAR(pose.position[2], maps_[0].position[2] + 0.01, 1e-12);
  }
}

TEST_F(RobotLinkTest, AGoalWithNanIsRefusedAndCounted) {
  RobotLink link(bus_, clock_, executive_, "1", {.on_lost_planner = OnLostPlanner::kEnd});
  RobotEnd end;
  send(link, goal(1, std::nan("")));
  motion_goal_t unturned = goal(2, 0);
  unturned.quaternion_xyzw[3] = 0;
  send(link, unturned);
  EXPECT_FALSE(run(link, nullptr, 30, &end));
  EXPECT_EQ(link.refused_goals(), 2u);
  EXPECT_EQ(last_state_.goal_id, 0);
}

TEST_F(RobotLinkTest, ALostPlannerEndsTheProgram) {
  RobotLink link(bus_, clock_, executive_, "1", {.on_lost_planner = OnLostPlanner::kEnd});
  Presence planner(bus_, clock_, Role::kPlanner, "1");
  RobotEnd end;
  EXPECT_FALSE(run(link, nullptr, 1000, &end));  // it waits for a first planner without limit
  EXPECT_FALSE(run(link, &planner, 500, &end));
  EXPECT_FALSE(run(link, nullptr, 270, &end));
  ASSERT_TRUE(run(link, nullptr, 40, &end));
  EXPECT_EQ(end.exit_status, kExitPeerLost);
}

TEST_F(RobotLinkTest, OrIsWaitedForInStandstill) {
  RobotLink link(bus_, clock_, executive_, "1", {.on_lost_planner = OnLostPlanner::kHold});
  Presence planner(bus_, clock_, Role::kPlanner, "1");
  RobotEnd end;
  EXPECT_FALSE(run(link, &planner, 50, &end));
  EXPECT_FALSE(run(link, nullptr, 1000, &end));
  EXPECT_EQ(executive_.snapshot().activity, RobotActivity::kIdle);
  EXPECT_FALSE(run(link, &planner, 50, &end));
  planner.say_finished("done");
  ASSERT_TRUE(run(link, nullptr, 5, &end));
  EXPECT_EQ(end.exit_status, kExitOk);
  EXPECT_NE(end.message.find("done"), std::string::npos);
}

TEST_F(RobotLinkTest, AVanishedCameraEndsTheProgram) {
  RobotLink link(bus_, clock_, executive_, "1", {.on_lost_planner = OnLostPlanner::kHold});
  robot_.vanish("the simulator has gone");
  RobotEnd end;
  bool over = false;
  for (int i = 0; i < 1000 && !over; ++i) over = run(link, nullptr, 1, &end);
  ASSERT_TRUE(over);
  EXPECT_EQ(end.exit_status, kExitPeerLost);
  EXPECT_EQ(end.message, "the simulator has gone");
}

TEST_F(RobotLinkTest, AReplayedOrForeignCommandMovesNothing) {
  RobotLink link(bus_, clock_, executive_, "1");
  RobotEnd end;
  command_t command{};
  command.payload = encode_message(goal(1, 0.1));
  command.size = static_cast<std::int32_t>(command.payload.size());
  command.expires = clock_.utime() + 1'000'000;
  command.counter = 1;
  command.robot = link.boot_id() + 1;
  publish_message(bus_, channel::kCommand, command);
  command.robot = link.boot_id();
  command.expires = clock_.utime();
  publish_message(bus_, channel::kCommand, command);
  EXPECT_FALSE(run(link, nullptr, 30, &end));
  EXPECT_EQ(link.command_counters().accepted, 0u);
  EXPECT_EQ(link.command_counters().refused(), 2u);
  EXPECT_EQ(last_state_.goal_id, 0);
}

TEST_F(RobotLinkTest, AStopHoldsUntilAResume) {
  RobotLink link(bus_, clock_, executive_, "1");
  RobotEnd end;
  send(link, CommandKind::kStop);
  EXPECT_FALSE(run(link, nullptr, 30, &end));
  EXPECT_EQ(last_state_.activity, 4);
  send(link, goal(1, 0.1));
  send(link, CommandKind::kPause);  // does not weaken the stop
  EXPECT_FALSE(run(link, nullptr, 30, &end));
  EXPECT_EQ(last_state_.activity, 4);
  EXPECT_EQ(last_state_.goal_id, 0);
  EXPECT_EQ(link.refused_goals(), 1u);
  send(link, CommandKind::kResume);
  send(link, goal(1, 0.1));
  EXPECT_FALSE(run(link, nullptr, 30, &end));
  EXPECT_LT(last_state_.activity, 3);
  EXPECT_EQ(last_state_.goal_id, 1);
}

TEST_F(RobotLinkTest, PausedItFollowsATrajectoryStoppedItDoesNot) {
  RobotLink link(bus_, clock_, executive_, "1");
  RobotEnd end;
  trajectory_t way{};
  way.sender = 99;
  way.trajectory_id = 1;
  std::vector<Eigen::Isometry3d> poses(2, Eigen::Isometry3d::Identity());
  poses[0].translation().x() = 0.1;
  poses[1].translation().y() = 0.1;
  set_waypoints(poses, &way);
  send(link, CommandKind::kPause);
  send(link, CommandKind::kTrajectory, encode_message(way));
  for (int i = 0; i < 3000 && last_state_.position[1] != 0.1; ++i) ASSERT_FALSE(run(link, nullptr, 1, &end));
  EXPECT_EQ(last_state_.position[1], 0.1);
  EXPECT_EQ(last_state_.planner, 99);
  EXPECT_EQ(last_state_.activity, 3);

  send(link, CommandKind::kStop);
  way.trajectory_id = 2;
  send(link, CommandKind::kTrajectory, encode_message(way));
  EXPECT_FALSE(run(link, nullptr, 30, &end));
  EXPECT_EQ(link.refused_goals(), 1u);
  send(link, CommandKind::kResume);
  way.waypoint[3] = std::nan("");
  send(link, CommandKind::kTrajectory, encode_message(way));
  way.waypoint.pop_back();
  way.numbers = 13;
  send(link, CommandKind::kTrajectory, encode_message(way));
  way.waypoint.clear();
  way.numbers = 0;
  send(link, CommandKind::kTrajectory, encode_message(way));
  EXPECT_FALSE(run(link, nullptr, 30, &end));
  EXPECT_EQ(link.refused_goals(), 4u);
}

TEST_F(RobotLinkTest, AGoalForgottenInAPauseIsShownAsSuch) {
  RobotLink link(bus_, clock_, executive_, "1");
  RobotEnd end;
  send(link, goal(1, 100));  // a long way
  EXPECT_FALSE(run(link, nullptr, 15, &end));
  EXPECT_EQ(last_state_.goal_id, 1);
  send(link, CommandKind::kPause);
  EXPECT_FALSE(run(link, nullptr, 15, &end));
  EXPECT_EQ(last_state_.activity, 3);
  EXPECT_EQ(last_state_.goal_id, 0);  // so that the planner sends it again
}

TEST_F(RobotLinkTest, SaysEveryCounterOnceASecond) {
  RobotLink link(bus_, clock_, executive_, "1");
  std::vector<status_t> statuses;
  subscribe_message<status_t>(bus_, channel::kStatus, &decode_, [&](const status_t& s) { statuses.push_back(s); });
  RobotEnd end;
  send(link, CommandKind::kStop);
  EXPECT_FALSE(run(link, nullptr, 310, &end));
  ASSERT_EQ(statuses.size(), 3u);
  const auto at = std::find(statuses[0].name.begin(), statuses[0].name.end(), "commands.accepted");
  ASSERT_NE(at, statuses[0].name.end());
  EXPECT_EQ(statuses[0].value[static_cast<std::size_t>(at - statuses[0].name.begin())], 1);
}

TEST_F(RobotLinkTest, EveryExposureIsShownSmallOnce) {
  receiver_ =
      std::make_unique<DepthMapReceiver>(bus_, clock_, [this](const depth_map_t& map) { maps_.push_back(map); });
  RobotLink link(bus_, clock_, executive_, "1");
  Presence planner(bus_, clock_, Role::kPlanner, "1");
  std::vector<preview_t> previews;
  subscribe_message<preview_t>(bus_, channel::kPreview, &decode_, [&](const preview_t& p) { previews.push_back(p); });
  RobotEnd end;
  send(link, goal(1, 0.1));
  for (int i = 0; i < 3000 && previews.empty(); ++i) ASSERT_FALSE(run(link, &planner, 1, &end)) << end.message;
  ASSERT_FALSE(run(link, &planner, 100, &end));
  ASSERT_EQ(previews.size(), 1u);
  EXPECT_EQ(maps_.size(), 1u);  // which went first
  EXPECT_EQ(previews[0].session, link.boot_id());
  EXPECT_EQ(previews[0].width, FakeRobot::camera().width);
  EXPECT_EQ(previews[0].height, FakeRobot::camera().height);
  ASSERT_GT(previews[0].jpeg.size(), 4u);
  EXPECT_EQ(previews[0].jpeg[0], 0xFF);  // as every JPEG begins
  EXPECT_EQ(previews[0].jpeg[1], 0xD8);
}

TEST_F(RobotLinkTest, APlannerOfAnotherVersionIsNamed) {
  RobotLink link(bus_, clock_, executive_, "1");
  PresenceOptions later;
  later.link_version = kLinkVersion + 1;
  Presence planner(bus_, clock_, Role::kPlanner, "9", later);
  RobotEnd end;
  ASSERT_TRUE(run(link, &planner, 10, &end));
  EXPECT_EQ(end.exit_status, kExitPeerLost);
  EXPECT_NE(end.message.find("the planner is version 9 (link 3)"), std::string::npos) << end.message;
}

}  // namespace
}  // namespace vantage
