#include "onboard/executive/executive.h"

#include <atomic>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "onboard/executive/stereo_view.h"
#include "tests/onboard/fake_robot.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

bool within(milliseconds patience, const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(milliseconds(2));
  }
  return true;
}

ViewGoal goal_at(std::int64_t id, const Eigen::Vector3d& position) {
  ViewGoal goal{1, id, 10 + id, Eigen::Isometry3d::Identity()};
  goal.T_world_camera.translation() = position;
  return goal;
}

class ExecutiveTest : public testing::Test {
 protected:
  FakeRobot robot_;
  StereoDepth matcher_{FakeRobot::camera(), FakeRobot::kBaseline_m, {.disparities = 16}};
  StereoView depth_{matcher_};
  FlightLimits limits_{5, 5};
  std::string why_;
};

TEST_F(ExecutiveTest, FliesExposesAndHandsOverOnce) {
  Executive executive(robot_, robot_, depth_, limits_);
  EXPECT_EQ(executive.snapshot().activity, RobotActivity::kIdle);
  ASSERT_TRUE(executive.take_goal(goal_at(3, {0.4, 0, 0}), &why_));
  std::optional<DepthMap> map;
  ASSERT_TRUE(within(milliseconds(5000), [&] { return (map = executive.fetch_depth_map()).has_value(); }));
  EXPECT_EQ(map->goal_id, 3);
  EXPECT_EQ(map->view_id, 13);
  EXPECT_EQ(map->T_world_camera.translation(), Eigen::Vector3d(0.4, 0, 0));
  EXPECT_FALSE(executive.fetch_depth_map());
  EXPECT_EQ(executive.snapshot().goal_id, 3);
  EXPECT_EQ(executive.snapshot().activity, RobotActivity::kIdle);
  EXPECT_GT(robot_.path().size(), 3u);  // it flew; it did not jump
}

TEST_F(ExecutiveTest, RefusesAPoseThatIsNotRigid) {
  Executive executive(robot_, robot_, depth_, limits_);
  ViewGoal bad = goal_at(1, {std::nan(""), 0, 0});
  EXPECT_FALSE(executive.take_goal(bad, &why_));
  EXPECT_EQ(why_, "one of its poses is not finite or not a rotation");
  bad = goal_at(1, {0, 0, 0});
  bad.T_world_camera.linear() *= 1.1;
  EXPECT_FALSE(executive.take_goal(bad, &why_));
  EXPECT_EQ(executive.snapshot().goal_id, 0);
  EXPECT_TRUE(robot_.path().empty());
}

TEST_F(ExecutiveTest, ANewGoalReplacesTheOneUnderWay) {
  limits_ = {0.5, 5};
  Executive executive(robot_, robot_, depth_, limits_);
  ASSERT_TRUE(executive.take_goal(goal_at(1, {5, 0, 0}), &why_));
  ASSERT_TRUE(within(milliseconds(5000), [&] { return robot_.path().size() > 5; }));
  ASSERT_TRUE(executive.take_goal(goal_at(2, {0, 0.1, 0}), &why_));
  std::optional<DepthMap> map;
  ASSERT_TRUE(within(milliseconds(8000), [&] { return (map = executive.fetch_depth_map()).has_value(); }));
  EXPECT_EQ(map->goal_id, 2);
  for (const Eigen::Isometry3d& pose : robot_.path()) EXPECT_LT(pose.translation().x(), 4.9);
}

TEST_F(ExecutiveTest, HoldStopsWhereItIs) {
  limits_ = {0.5, 5};
  Executive executive(robot_, robot_, depth_, limits_);
  ASSERT_TRUE(executive.take_goal(goal_at(1, {5, 0, 0}), &why_));
  ASSERT_TRUE(within(milliseconds(5000), [&] { return robot_.path().size() > 5; }));
  executive.hold();
  std::this_thread::sleep_for(milliseconds(100));
  const std::size_t stopped = robot_.path().size();
  std::this_thread::sleep_for(milliseconds(200));
  EXPECT_EQ(robot_.path().size(), stopped);
  EXPECT_EQ(executive.snapshot().activity, RobotActivity::kIdle);
  EXPECT_FALSE(executive.fetch_depth_map());
}

TEST_F(ExecutiveTest, GoesThroughEveryWaypointInOrderAndDoesNotExposeUnasked) {
  Executive executive(robot_, robot_, depth_, limits_);
  const int exposures = robot_.exposures();
  ViewGoal way = goal_at(1, {0.2, 0.2, 0});
  way.expose = false;
  for (const Eigen::Vector3d& position : {Eigen::Vector3d(0.2, 0, 0), Eigen::Vector3d(0, 0.2, 0)}) {
    way.via.emplace_back(Eigen::Translation3d(position));
  }
  ASSERT_TRUE(executive.take_goal(way, &why_));
  ASSERT_TRUE(within(milliseconds(5000), [&] { return executive.snapshot().activity == RobotActivity::kIdle; }));
  std::size_t next = 0;
  const std::vector<Eigen::Vector3d> corners = {{0.2, 0, 0}, {0, 0.2, 0}, {0.2, 0.2, 0}};
  for (const Eigen::Isometry3d& pose : robot_.path()) {
    if (next < corners.size() && pose.translation().isApprox(corners[next])) ++next;
  }
  EXPECT_EQ(next, corners.size());
  EXPECT_EQ(executive.snapshot().goal_id, 1);
  EXPECT_FALSE(executive.fetch_depth_map());
  EXPECT_EQ(robot_.exposures(), exposures);
  way.via[0].linear() *= 2;
  EXPECT_FALSE(executive.take_goal(way, &why_));
}

TEST_F(ExecutiveTest, ADepthMapThatIsNotFetchedIsNotReplaced) {
  Executive executive(robot_, robot_, depth_, limits_);
  ASSERT_TRUE(executive.take_goal(goal_at(1, {0.1, 0, 0}), &why_));
  ASSERT_TRUE(within(milliseconds(5000), [&] { return executive.snapshot().activity == RobotActivity::kIdle; }));
  ASSERT_TRUE(executive.take_goal(goal_at(2, {0.2, 0, 0}), &why_));
  std::this_thread::sleep_for(milliseconds(200));
  EXPECT_EQ(executive.fetch_depth_map()->goal_id, 1);
  std::optional<DepthMap> map;
  ASSERT_TRUE(within(milliseconds(5000), [&] { return (map = executive.fetch_depth_map()).has_value(); }));
  EXPECT_EQ(map->goal_id, 2);
}

/// Wants frames from three places beside the view, and to see the way there.
class ThreePlaces final : public ViewDepth {
 public:
  explicit ThreePlaces(StereoDepth& matcher) : matcher_(matcher) {}
  bool fits(const Frame&, std::string*) override { return true; }
  bool watches_the_way() const override { return true; }
  void pass(const Frame&) override { ++passed; }
  void begin(const Frame& key) override {
    key_ = key;
    added = 0;
  }
  std::optional<Eigen::Isometry3d> next_pose() override {
    if (added == 3) return {};
    return *key_.T_world_camera * Eigen::Translation3d(0, 0.1 * (added + 1), 0);
  }
  void add(const Frame& frame) override {
    EXPECT_TRUE(frame.T_world_camera->translation().isApprox(next_pose()->translation()));
    ++added;
  }
  bool finish(DepthMap* map, std::string* why) override { return matcher_.compute(key_, map, why); }
  std::vector<KeyPose> corrections() override { return std::exchange(corrected, {}); }

  std::vector<KeyPose> corrected;  // the test's until the executive runs
  std::atomic<int> passed = 0, added = 0;

 private:
  StereoDepth& matcher_;
  Frame key_;
};

TEST_F(ExecutiveTest, MovesAroundTheViewAsTheDepthAsks) {
  ThreePlaces depth(matcher_);
  Executive executive(robot_, robot_, depth, limits_);
  ASSERT_TRUE(executive.take_goal(goal_at(1, {0.4, 0, 0}), &why_));
  std::optional<DepthMap> map;
  ASSERT_TRUE(within(milliseconds(5000), [&] { return (map = executive.fetch_depth_map()).has_value(); }));
  EXPECT_EQ(depth.added, 3);
  EXPECT_GT(depth.passed, 0);
  EXPECT_EQ(map->T_world_camera.translation(), Eigen::Vector3d(0.4, 0, 0));  // the view's, not where it ended
  EXPECT_TRUE(executive.snapshot().T_world_camera.translation().isApprox(Eigen::Vector3d(0.4, 0.3, 0)));
  EXPECT_EQ(executive.fetch_frame()->T_world_camera->translation(), Eigen::Vector3d(0.4, 0, 0));
}

TEST_F(ExecutiveTest, HandsOverCorrectionsOnce) {
  ThreePlaces depth(matcher_);
  depth.corrected = {{17, Eigen::Isometry3d(Eigen::Translation3d(1, 2, 3))}};
  Executive executive(robot_, robot_, depth, limits_);
  EXPECT_TRUE(executive.fetch_corrections().empty());
  ASSERT_TRUE(executive.take_goal(goal_at(1, {0.1, 0, 0}), &why_));
  std::vector<KeyPose> corrections;
  ASSERT_TRUE(within(milliseconds(5000), [&] { return !(corrections = executive.fetch_corrections()).empty(); }));
  ASSERT_EQ(corrections.size(), 1u);
  EXPECT_EQ(corrections[0].utime, 17);
  EXPECT_EQ(corrections[0].T_world_camera.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(executive.fetch_corrections().empty());
}

TEST_F(ExecutiveTest, HoldBreaksOffTheMotionAroundAView) {
  limits_ = {0.2, 5};
  ThreePlaces depth(matcher_);
  Executive executive(robot_, robot_, depth, limits_);
  ASSERT_TRUE(executive.take_goal(goal_at(1, {0.02, 0, 0}), &why_));
  ASSERT_TRUE(within(milliseconds(5000), [&] { return depth.added == 1; }));
  executive.hold();
  std::this_thread::sleep_for(milliseconds(100));
  const std::size_t stopped = robot_.path().size();
  std::this_thread::sleep_for(milliseconds(200));
  EXPECT_EQ(robot_.path().size(), stopped);
  EXPECT_LT(depth.added, 3);
  EXPECT_FALSE(executive.fetch_depth_map());
}

TEST_F(ExecutiveTest, SaysWhenTheCameraHasGone) {
  Executive executive(robot_, robot_, depth_, limits_);
  EXPECT_FALSE(executive.ended());
  robot_.vanish("unplugged");
  ASSERT_TRUE(within(milliseconds(2000), [&] { return executive.ended().has_value(); }));
  EXPECT_EQ(executive.ended()->message, "unplugged");
  EXPECT_EQ(executive.ended()->exit_status, kExitPeerLost);
}

TEST_F(ExecutiveTest, DoesNotStartOnACameraOfAnotherSize) {
  CameraModel other = FakeRobot::camera();
  other.width = 64;
  StereoDepth matcher(other, 0.1, {.disparities = 16});
  StereoView depth(matcher);
  try {
    Executive executive(robot_, robot_, depth, limits_);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("128 x 48 pixels, the rig's camera 64 x 48"), std::string::npos);
  }
}

}  // namespace
}  // namespace vantage
