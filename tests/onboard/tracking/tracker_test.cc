#include "onboard/tracking/tracker.h"

#include <random>

#include <gtest/gtest.h>

#include "onboard/tracking/recording_run.h"
#include "onboard/tracking/trajectory_error.h"
#include "tests/onboard/tracking/textured_scene.h"

namespace vantage::tracking {
namespace {

constexpr double kStep_s = 0.04;

struct Journey {
  std::vector<TrackingResult> results;
  std::vector<StampedPose> trajectory, truth;
};

Eigen::Isometry3d swaying(int i) { return TexturedScene::sway(kStep_s * i); }

/// Feeds `frames` frames of the swaying camera; `at` may replace a frame or its prior.
template <typename At>
Journey run(Tracker* tracker, int frames, At at) {
  Journey journey;
  for (int i = 0; i < frames; ++i) {
    const auto [frame, prior] = at(i);
    const TrackingResult result = tracker->process(frame, prior);
    journey.results.push_back(result);
    journey.truth.push_back({0.1 * i, swaying(i)});
  }
  tracker->finish();
  for (int i = 0; i < frames; ++i) {
    if (const auto pose = tracker->pose_of(journey.results[static_cast<std::size_t>(i)])) {
      journey.trajectory.push_back({0.1 * i, *pose});
    }
  }
  return journey;
}

using Input = std::pair<Frame, std::optional<PosePrior>>;

Input seen(int i) {
  return {TexturedScene::render(quarter_camera(), swaying(i), static_cast<std::uint64_t>(i)), std::nullopt};
}

TEST(Tracker, FollowsAHandHeldCameraToAThousandthOfItsWay) {
  Tracker tracker(quarter_camera());
  const Journey r = run(&tracker, 120, seen);
  int first = 0;
  while (first < 120 && !r.results[static_cast<std::size_t>(first)].has_pose) ++first;
  EXPECT_LT(first, 25);
  for (int i = first; i < 120; ++i) EXPECT_TRUE(r.results[static_cast<std::size_t>(i)].has_pose) << "frame " << i;
  const TrajectoryError error = trajectory_error(r.trajectory, r.truth, true);
  EXPECT_GT(error.path_m, 0.5);
  EXPECT_LT(error.rmse_m, 0.003 * error.path_m);
  const TrackingResult& last = r.results.back();
  EXPECT_EQ(last.state, TrackingState::kTracking);
  EXPECT_GT(last.nearest_distance_m, 0);
  EXPECT_LE(last.nearest_distance_m, last.median_distance_m);
  EXPECT_TRUE(last.covariance.diagonal().minCoeff() > 0);
}

TEST(Tracker, TwoRunsAreTheSameToTheBit) {
  Tracker a(quarter_camera()), b(quarter_camera());
  for (int i = 0; i < 50; ++i) {
    const TrackingResult x = a.process(seen(i).first), y = b.process(seen(i).first);
    ASSERT_EQ(x.has_pose, y.has_pose);
    ASSERT_TRUE(x.T_world_camera.matrix() == y.T_world_camera.matrix()) << "frame " << i;
  }
}

TEST(Tracker, SaysAtOnceThatTheLensIsCoveredAndComesBack) {
  Tracker tracker(quarter_camera());
  const Journey r = run(&tracker, 110, [](int i) -> Input {
    if (i < 60 || i >= 80) return seen(i);
    return {TexturedScene::covered(quarter_camera(), static_cast<std::uint64_t>(i)), std::nullopt};
  });
  EXPECT_TRUE(r.results[59].has_pose);
  EXPECT_EQ(r.results[60].state, TrackingState::kLost);
  for (int i = 60; i < 80; ++i) EXPECT_FALSE(r.results[static_cast<std::size_t>(i)].has_pose) << "frame " << i;
  EXPECT_EQ(r.results[70].state, TrackingState::kRelocalising);
  int back = 80;
  while (back < 110 && !r.results[static_cast<std::size_t>(back)].has_pose) ++back;
  EXPECT_LE(back, 90) << "within ten frames of seeing a known place";
  EXPECT_LT(trajectory_error(r.trajectory, r.truth, true).rmse_m, 0.005);
}

TEST(Tracker, AJumpOfFifteenDegreesIsCaught) {
  Tracker tracker(quarter_camera());
  std::vector<bool> posed;
  std::vector<StampedPose> trajectory, truth;
  for (int i = 0; i < 90; ++i) {
    Eigen::Isometry3d pose = swaying(i);
    if (i >= 60) {
      pose.linear() = Eigen::AngleAxisd(15 * M_PI / 180, Eigen::Vector3d::UnitZ()).toRotationMatrix() * pose.linear();
    }
    const TrackingResult result =
        tracker.process(TexturedScene::render(quarter_camera(), pose, static_cast<std::uint64_t>(i)));
    posed.push_back(result.has_pose);
    truth.push_back({0.1 * i, pose});
    if (result.has_pose) trajectory.push_back({0.1 * i, result.T_world_camera});
  }
  int back = 60;
  while (back < 90 && !posed[static_cast<std::size_t>(back)]) ++back;
  EXPECT_LE(back, 70);
  EXPECT_LT(trajectory_error(trajectory, truth, true).rmse_m, 0.005);
}

TEST(Tracker, KinematicsStartAtOnceAndGiveTheScale) {
  constexpr std::uint64_t kSeed = 5;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::vector<StampedPose> truth;
  for (int i = 0; i < 180; ++i) truth.push_back({0.1 * i, swaying(i)});
  const std::vector<StampedPose> robot = with_noise(truth, 0.002, 0.0035, kSeed);
  Tracker tracker(quarter_camera());
  const Journey r = run(&tracker, 180, [&](int i) -> Input {
    return {seen(i).first, PosePrior{robot[static_cast<std::size_t>(i)].T_world_camera, 0.002, 0.0035}};
  });
  EXPECT_TRUE(r.results.front().has_pose);
  EXPECT_EQ(r.trajectory.size(), 180U);
  const TrajectoryError error = trajectory_error(r.trajectory, r.truth, true);
  EXPECT_NEAR(error.scale, 1, 0.01);
  EXPECT_LT(trajectory_error(r.trajectory, r.truth, false).rmse_m, 0.01);
}

TEST(Tracker, AMappingThreadGivesTheSameAccuracy) {
  TrackerOptions options;
  options.mapper.threaded = true;
  Tracker tracker(quarter_camera(), options);
  const Journey r = run(&tracker, 80, seen);
  const TrajectoryError error = trajectory_error(r.trajectory, r.truth, true);
  EXPECT_GT(error.poses, 50U);
  EXPECT_LT(error.rmse_m, 0.005);
}

TEST(Tracker, ALensThatDistortsIsTrackedAsWell) {
  CameraModel wide = quarter_camera();
  wide.fx = wide.fy = 200;
  wide.distortion = Distortion::kRadTan;
  wide.coefficients = {-0.28, 0.07, 0.0005, -0.0003, 0};
  Tracker tracker(wide);
  const Journey r = run(&tracker, 80, [&](int i) -> Input {
    return {TexturedScene::render(wide, swaying(i), static_cast<std::uint64_t>(i)), std::nullopt};
  });
  const TrajectoryError error = trajectory_error(r.trajectory, r.truth, true);
  EXPECT_GT(error.poses, 50U);
  EXPECT_LT(error.rmse_m, 0.005);
}

TEST(Tracker, AFullMapLetsItsMostRedundantKeyFrameGo) {
  TrackerOptions options;
  options.mapper.most_key_frames = 10;
  options.key_frame_parallax = 0.03;
  Tracker tracker(quarter_camera(), options);
  std::size_t most = 0;
  const Journey r = run(&tracker, 120, [&](int i) -> Input {
    most = std::max(most, tracker.mapper().key_frames());
    return seen(i);
  });
  EXPECT_GE(most, 10U);
  EXPECT_LE(most, 12U);
  EXPECT_LT(trajectory_error(r.trajectory, r.truth, true).rmse_m, 0.006) << "frames of key frames that went are kept";
}

/// Turns of a camera that goes nowhere.
Eigen::Isometry3d turning(int way, int i) {
  const Eigen::Vector3d at(0.2, -0.3, 0.9);
  const double t = kStep_s * i;
  switch (way) {
    case 0:
      return TexturedScene::pose(at, 0.6 * std::sin(0.7 * t));  // to and fro
    case 1:
      return TexturedScene::pose(at, -0.4 + 0.15 * t);  // on and on
    case 2:
      return TexturedScene::pose(at, 0.3 * std::sin(0.9 * t), 0.35 + 0.25 * std::sin(1.3 * t));
    default: {
      Eigen::Isometry3d T = TexturedScene::pose(at);  // about its axis
      T.linear() = T.linear() * Eigen::AngleAxisd(0.8 * std::sin(0.8 * t), Eigen::Vector3d::UnitZ()).toRotationMatrix();
      return T;
    }
  }
}

TEST(Tracker, ACameraThatOnlyTurnsClaimsNoMap) {
  for (int way = 0; way < 4; ++way) {
    std::vector<Frame> frames;
    for (int i = 0; i < 80; ++i) {
      const auto seed = static_cast<std::uint64_t>(1000 * way + i);
      frames.push_back(TexturedScene::render(quarter_camera(), turning(way, i), seed, 2));
    }
    for (const double focal_error : {0.0, 0.03, -0.03}) {  // nor when turns are taken for larger or smaller ones
      CameraModel believed = quarter_camera();
      believed.fx *= 1 + focal_error;
      believed.fy *= 1 + focal_error;
      Tracker tracker(believed);
      for (const Frame& frame : frames) {
        const TrackingResult result = tracker.process(frame);
        ASSERT_FALSE(result.has_pose) << "way " << way << ", frame " << frame.sequence << ", focal " << focal_error;
        ASSERT_EQ(result.state, TrackingState::kStarting);
      }
    }
  }
}

TEST(Tracker, ACameraThatOnlyTurnsAtFirstStartsWhenItMoves) {
  Tracker tracker(quarter_camera());
  int first = -1;
  for (int i = 0; i < 100; ++i) {
    Eigen::Isometry3d pose = turning(0, i);
    if (i >= 40) pose.translation().y() += 0.012 * (i - 40);
    const TrackingResult result =
        tracker.process(TexturedScene::render(quarter_camera(), pose, static_cast<std::uint64_t>(i)));
    if (result.has_pose && first < 0) first = i;
  }
  EXPECT_GT(first, 40);
  EXPECT_LT(first, 80);
}

TEST(Tracker, FramesOfAnotherSizeAreFramesWithoutAPose) {
  Tracker tracker(quarter_camera());
  CameraModel small = quarter_camera();
  small.width = 160;
  EXPECT_FALSE(tracker.process(TexturedScene::covered(small, 0)).has_pose);
  EXPECT_FALSE(tracker.process(Frame{}).has_pose);
}

TEST(Tracker, OptionsThatContradictThemselvesAreRefused) {
  TrackerOptions options;
  options.weak_inliers = 5;
  std::string why;
  EXPECT_FALSE(options.valid(&why));
  EXPECT_NE(why.find("lost_inliers"), std::string::npos);
  EXPECT_THROW(Tracker(quarter_camera(), options), std::invalid_argument);
  EXPECT_THROW(Tracker(CameraModel{}), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::tracking
