// A single simulated camera is led to views as the executive would lead it. The simulator's exact depth is the oracle.
#include "onboard/monocular_depth.h"

#include <cmath>
#include <map>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "tests/onboard/loose_camera.h"

namespace vantage {
namespace {

class MonocularDepthTest : public testing::TestWithParam<int> {
 protected:
  static Rig rig() {
    Rig rig;
    rig.camera = LooseCamera::model();
    return rig;
  }
  static Eigen::Isometry3d view(double angle_rad) {
    return look_at({0.6 * std::cos(angle_rad), 0.6 * std::sin(angle_rad), 0.35}, {0, 0, 0.12});
  }

  /// Frames on the straight way to a view.
  void travel(const Eigen::Isometry3d& to) {
    constexpr int kSteps = 8;
    for (int k = 1; k < kSteps; ++k) {
      const double share = static_cast<double>(k) / kSteps;
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation() = (1 - share) * at_.translation() + share * to.translation();
      pose.linear() = Eigen::Quaterniond(at_.linear()).slerp(share, Eigen::Quaterniond(to.linear())).toRotationMatrix();
      depth_.pass(camera_.frame_at(pose));
    }
    at_ = to;
  }

  Quality measure(const Eigen::Isometry3d& goal) {
    const Frame key = camera_.frame_at(goal);
    const Eigen::Isometry3d T_world_key = camera_.true_pose();
    depth_.begin(key);
    while (const auto pose = depth_.next_pose()) {
      depth_.add(camera_.frame_at(*pose));
      at_ = *pose;
    }
    DepthMap map;
    std::string why;
    EXPECT_TRUE(depth_.finish(&map, &why)) << why;
    EXPECT_TRUE(map.valid(&why)) << why;
    told_[map.utime] = {map.T_world_camera, T_world_key};
    return quality_of(map, camera_, T_world_key);
  }

  LooseCamera camera_{static_cast<std::uint32_t>(GetParam())};
  MonocularDepth depth_{rig()};
  Eigen::Isometry3d at_ = view(0);
  struct Told {
    Eigen::Isometry3d T_world_camera, truth;
    double off_m() const { return (T_world_camera.translation() - truth.translation()).norm(); }
  };
  std::map<std::int64_t, Told> told_;  ///< of each map, by its time
};

TEST_P(MonocularDepthTest, ViewsAroundAnObjectAreMeasuredInTheRobotsFrame) {
  for (int i = 0; i < 5; ++i) {
    if (i > 0) travel(view(0.5 * i));
    const Quality quality = measure(view(0.5 * i));
    SCOPED_TRACE("view " + std::to_string(i));
    EXPECT_GT(quality.measured, 0.5);
    EXPECT_GT(quality.right, 0.9);
    // The robot's 2 mm on 40 places of a spiral of 7 cm leave 0.9 % to the unit of length (standard deviation).
    EXPECT_LT(quality.median_error, 0.027);
    EXPECT_LT(quality.off_m, 0.003);
    EXPECT_LT(quality.off_rad, 0.005);
  }
  const MonocularCounts& counts = depth_.counts();
  EXPECT_EQ(counts.views, 5u);
  EXPECT_EQ(counts.losses, 0u);
  // What is learnt later moves earlier views; it leaves them where they stood, within the carrier's noise.
  double before_m = 0, after_m = 0;
  for (const auto& [utime, told] : told_) before_m += told.off_m();
  for (const KeyPose& pose : depth_.corrections()) {
    ASSERT_TRUE(told_.contains(pose.utime));
    told_[pose.utime].T_world_camera = pose.T_world_camera;
  }
  for (const auto& [utime, told] : told_) after_m += told.off_m();
  EXPECT_LT(after_m, std::max(before_m, 5 * 0.002));  // five views
  EXPECT_TRUE(depth_.corrections().empty());          // each once
  // The first view tells nothing of the unit of length; the last stands on tracking.
  EXPECT_GE(counts.views_by_kinematics, 1u);
  EXPECT_LE(counts.views_by_kinematics, 4u);
}

TEST_P(MonocularDepthTest, WithoutParallaxNothingIsClaimed) {
  camera_.sigma_m = 0;
  const Eigen::Isometry3d goal = view(0);
  depth_.begin(camera_.frame_at(goal));
  while (depth_.next_pose()) depth_.add(camera_.frame_at(goal));
  DepthMap map;
  std::string why;
  ASSERT_TRUE(depth_.finish(&map, &why)) << why;
  EXPECT_EQ(std::count(map.state.begin(), map.state.end(), DepthState::kConverged), 0);
}

TEST_P(MonocularDepthTest, ACoveredLensClaimsNothingAndTheNextViewIsWhole) {
  camera_.covered = true;
  EXPECT_EQ(measure(view(0)).measured, 0);
  camera_.covered = false;
  travel(view(0.4));
  const Quality quality = measure(view(0.4));
  EXPECT_GT(quality.measured, 0.5);
  EXPECT_GT(quality.right, 0.9);
}

TEST_P(MonocularDepthTest, AViewThatIsBrokenOffLeavesNothingBehind) {
  depth_.begin(camera_.frame_at(view(0)));
  for (int i = 0; i < 5; ++i) {
    at_ = depth_.next_pose().value();
    depth_.add(camera_.frame_at(at_));
  }
  travel(view(0.4));
  const Quality quality = measure(view(0.4));
  EXPECT_GT(quality.measured, 0.5);
  EXPECT_GT(quality.right, 0.9);
  EXPECT_EQ(depth_.counts().views, 1u);
}

INSTANTIATE_TEST_SUITE_P(Seeds, MonocularDepthTest, testing::Values(1, 2, 3));

TEST(MonocularDepth, AsksForFramesOnASpiralAroundTheView) {
  Rig rig;
  rig.camera = LooseCamera::model();
  MonocularDepthOptions options;
  options.frames = 10;
  options.distance_m = 0.5;
  MonocularDepth depth(rig, options);
  LooseCamera camera(1);
  const Eigen::Isometry3d goal = look_at({0.6, 0, 0.35}, {0, 0, 0.12});
  depth.begin(camera.frame_at(goal));
  double before_m = 0;
  int places = 0;
  while (const auto pose = depth.next_pose()) {
    const Eigen::Vector3d shift = goal.inverse() * pose->translation();
    EXPECT_NEAR(shift.z(), 0, 1e-9);
    EXPECT_GT(shift.norm(), before_m);
    before_m = shift.norm();
    EXPECT_TRUE(pose->linear().isApprox(goal.linear(), 1e-12));
    ++places;  // no frame is added: it does not have enough before the last place
  }
  EXPECT_EQ(places, 10);
  EXPECT_NEAR(before_m, options.reach * options.distance_m, 1e-9);
}

TEST(MonocularDepth, RefusesFramesThatDoNotFit) {
  Rig rig;
  rig.camera = LooseCamera::model();
  MonocularDepth depth(rig);
  LooseCamera camera(1);
  Frame frame = camera.frame_at(look_at({0.6, 0, 0.35}, {0, 0, 0.12}));
  std::string why;
  EXPECT_TRUE(depth.fits(frame, &why));
  frame.T_world_camera.reset();
  EXPECT_FALSE(depth.fits(frame, &why));
  EXPECT_EQ(why, "the frame's pose is not known");
  depth.begin(frame);
  EXPECT_FALSE(depth.next_pose());
  frame.image.width = 100;
  EXPECT_FALSE(depth.fits(frame, &why));
  EXPECT_EQ(why, "an image is 100 x 240 pixels, the rig's camera 376 x 240");
  depth.begin(frame);
  EXPECT_FALSE(depth.next_pose());
  DepthMap map;
  EXPECT_FALSE(depth.finish(&map, &why));
}

TEST(MonocularDepth, RefusesOptionsThatMakeNoSense) {
  Rig rig;
  rig.camera = LooseCamera::model();
  const auto with = [&](auto change) {
    MonocularDepthOptions options;
    change(&options);
    return [&rig, options] { MonocularDepth depth(rig, options); };
  };
  using Options = MonocularDepthOptions;
  EXPECT_THROW(with([](Options* o) { o->reach = 0; })(), std::invalid_argument);
  EXPECT_THROW(with([](Options* o) { o->frames = 1; })(), std::invalid_argument);
  EXPECT_THROW(with([](Options* o) { o->distance_m = std::nan(""); })(), std::invalid_argument);
  EXPECT_THROW(with([](Options* o) { o->sure_share = 0; })(), std::invalid_argument);
  EXPECT_THROW(with([](Options* o) { o->threads = -1; })(), std::invalid_argument);
  rig.camera.distortion = Distortion::kRadTan;
  EXPECT_THROW(MonocularDepth{rig}, std::invalid_argument);
}

}  // namespace
}  // namespace vantage
