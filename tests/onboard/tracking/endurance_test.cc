// What the tracker holds stays bounded, whatever comes and however long.

#include <gtest/gtest.h>

#include "onboard/tracking/endurance_run.h"
#include "tests/onboard/tracking/textured_scene.h"

namespace vantage::tracking {
namespace {

constexpr int kRoundFrames = 100;

/// A round about a point of the wall: the last frame's successor is the first.
Eigen::Isometry3d circling(int i) {
  const double angle = 2 * M_PI * i / kRoundFrames;
  return TexturedScene::pose({0.2 + 0.05 * std::cos(angle), -0.3 + 0.25 * std::sin(angle), 0.9 + 0.1 * std::cos(angle)},
                             0.1 * std::sin(angle));
}

TEST(Endurance, RoundsOnTheSameCircleAddNothingAndLoseNothing) {
  TrackerOptions options;
  options.mapper.most_key_frames = 30;
  Tracker tracker(quarter_camera(), options);
  constexpr int kRounds = 8;
  std::vector<Frame> images;
  for (int i = 0; i < kRoundFrames; ++i) {
    images.push_back(TexturedScene::render(quarter_camera(), circling(i), static_cast<std::uint64_t>(i)));
  }
  MapSize half;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<StampedPose> trajectory, truth;
    for (int i = 0; i < kRoundFrames; ++i) {
      Frame frame = images[static_cast<std::size_t>(i)];
      frame.sequence = static_cast<std::uint64_t>(round * kRoundFrames + i);
      frame.capture_time_ns = static_cast<std::int64_t>(frame.sequence) * 33'333'333;
      const TrackingResult result = tracker.process(frame);
      truth.push_back({0.1 * i, circling(i)});
      if (result.has_pose) trajectory.push_back({0.1 * i, result.T_world_camera});
      if (round > 0) {
        EXPECT_TRUE(result.has_pose) << "round " << round << ", frame " << i;
      }
    }
    const MapSize now = tracker.mapper().size();
    EXPECT_LE(now.key_frames, 31U);
    EXPECT_LE(now.corrections, now.key_frames);
    EXPECT_LE(now.landmarks, 31U * 300U);
    if (round == kRounds / 2 - 1) half = now;
    if (round > 0) {
      EXPECT_LT(trajectory_error(trajectory, truth, true).rmse_m, 0.01) << "round " << round;
    }
  }
  const MapSize end = tracker.mapper().size();
  EXPECT_LE(end.landmarks, half.landmarks + half.landmarks / 4);
  EXPECT_LE(end.observations, half.observations + half.observations / 4);
}

TEST(Endurance, PiecesOfMapThatAreNeverJoinedStayFewerThanAllowed) {
  // The camera is carried, covered, to one place after the other that shows nothing of those before.
  TrackerOptions options;
  options.mapper.most_key_frames = 14;
  options.probation_frames = 1;
  Tracker tracker(quarter_camera(), options);
  std::size_t most = 0;
  int pieces = 0;
  std::uint64_t sequence = 0;
  for (int place = 0; place < 8; ++place) {
    for (int i = 0; i < 40; ++i, ++sequence) {
      Eigen::Isometry3d pose = circling(i);
      pose.translation().y() -= 30.0 * place;
      const bool covered = i >= 37;
      const TrackingResult result = tracker.process(covered ? TexturedScene::covered(quarter_camera(), sequence)
                                                            : TexturedScene::render(quarter_camera(), pose, sequence));
      pieces += result.began_map;
      most = std::max(most, tracker.mapper().key_frames());
    }
  }
  EXPECT_GE(pieces, 5);
  EXPECT_GE(most, 14U);
  EXPECT_LE(most, 17U) << "two of a new piece, and one that makes room for itself";
}

}  // namespace
}  // namespace vantage::tracking
