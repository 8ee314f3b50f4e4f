// A camera in somebody's hand goes round an object. The simulator's exact depth and poses are the oracle.
#include "onboard/hand_held_camera.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "calib/look_at.h"
#include "tests/onboard/loose_camera.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

/// Frames on an arc round the object, wavering as a hand does, then the end.
class Walk final : public FrameSource {
 public:
  Walk(std::uint32_t seed, int frames) : camera_(seed), frames_(frames) { camera_.sigma_m = camera_.sigma_rad = 0; }

  static Eigen::Isometry3d pose(int i) {
    const double angle = 0.012 * i, waver = 0.02 * std::sin(0.31 * i);
    return look_at({0.6 * std::cos(angle), 0.6 * std::sin(angle), 0.35 + waver}, {0.3 * waver, 0, 0.12});
  }
  FrameStatus next(Frame* frame, milliseconds) override {
    if (i_ >= frames_) {
      end_reason_ = "the walk is over";
      return FrameStatus::kEnded;
    }
    *frame = camera_.frame_at(pose(i_));
    frame->T_world_camera.reset();  // nobody knows where a hand is
    poses_[frame->capture_time_ns / 1000] = pose(i_++);
    return FrameStatus::kFrame;
  }
  std::string end_reason() const override { return end_reason_; }

  const Eigen::Isometry3d& pose_at(std::int64_t utime) const { return poses_.at(utime); }
  const LooseCamera& camera() const { return camera_; }

 private:
  LooseCamera camera_;
  int frames_, i_ = 0;
  std::map<std::int64_t, Eigen::Isometry3d> poses_;
  std::string end_reason_;
};

Rig rig() {
  Rig rig;
  rig.camera = LooseCamera::model();
  return rig;
}

/// All depth maps until the end.
std::vector<DepthMap> maps_of(HandHeldCamera& camera) {
  std::vector<DepthMap> maps;
  while (!camera.ended()) {
    if (auto map = camera.fetch_depth_map()) {
      maps.push_back(std::move(*map));
    } else {
      std::this_thread::sleep_for(milliseconds(2));
    }
  }
  return maps;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class HandHeldCameraTest : public testing::TestWithParam<std::uint32_t> {};

TEST_P(HandHeldCameraTest, DepthMapsOfAWalkAgreeInOneWorldOfUnknownSize) {
  Walk walk(GetParam(), 120);
  HandHeldOptions options;
  options.distance_m = 0.9;  // a bad guess: it is 0.64
  options.every_frame = true;
  HandHeldCamera camera(walk, rig(), options);
  std::vector<DepthMap> maps = maps_of(camera);
  EXPECT_EQ(camera.ended()->exit_status, kExitOk);
  EXPECT_EQ(camera.ended()->message, "the walk is over");
  for (const KeyPose& moved : camera.fetch_corrections()) {
    for (DepthMap& map : maps) {
      if (map.utime == moved.utime) map.T_world_camera = moved.T_world_camera;
    }
  }
  ASSERT_GE(maps.size(), 4u);
  std::vector<double> scales;
  for (const DepthMap& map : maps) {
    std::string why;
    EXPECT_TRUE(map.valid(&why)) << why;
    const std::vector<float> truth = walk.camera().depth_from(walk.pose_at(map.utime));
    std::vector<double> ratios;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (map.state[i] != DepthState::kConverged || !(truth[i] < 3)) continue;
      ratios.push_back(static_cast<double>(map.depth_m[i]) / static_cast<double>(truth[i]));
    }
    EXPECT_GT(ratios.size(), truth.size() / 4);
    ASSERT_FALSE(ratios.empty());
    scales.push_back(median(ratios));
    const auto right = std::count_if(ratios.begin(), ratios.end(),
                                     [&](double ratio) { return std::abs(ratio / scales.back() - 1) < 0.03; });
    EXPECT_GT(static_cast<double>(right), 0.9 * static_cast<double>(ratios.size()));
  }
  // One scale for all depths, and for the way between the first and the last view.
  const double scale = median(scales);
  for (const double s : scales) EXPECT_NEAR(s / scale, 1, 0.03);
  const auto way = [](const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
    return (a.translation() - b.translation()).norm();
  };
  EXPECT_NEAR(way(maps.front().T_world_camera, maps.back().T_world_camera) /
                  way(walk.pose_at(maps.front().utime), walk.pose_at(maps.back().utime)) / scale,
              1, 0.03);
  // The first view stands where it was said to.
  EXPECT_LT((maps.front().T_world_camera.translation().norm() - 0.9), 0.2);
  EXPECT_GT(camera.snapshot().T_world_camera.translation().z(), 0);
  EXPECT_EQ(camera.counts().frames, 120u);
  EXPECT_EQ(camera.counts().passed_over, 0u);
}

INSTANTIATE_TEST_SUITE_P(Seeds, HandHeldCameraTest, testing::Values(1u, 2u));

TEST(HandHeldCamera, RefusesGoalsAndSaysWhy) {
  Walk walk(1, 3);
  HandHeldCamera camera(walk, rig());
  std::string why;
  EXPECT_FALSE(camera.take_goal({}, &why));
  EXPECT_NE(why.find("--no-planning"), std::string::npos);
  EXPECT_EQ(camera.snapshot().goal_id, 0);
}

TEST(HandHeldCamera, ACameraThatGoesIsNoGoodEnd) {
  Walk walk(1, 3);
  HandHeldCamera camera(walk, rig());
  maps_of(camera);
  EXPECT_EQ(camera.ended()->exit_status, kExitPeerLost);
}

TEST(HandHeldCamera, DoesNotStartWithoutAFrameThatFits) {
  Walk none(1, 0);
  EXPECT_THROW(HandHeldCamera(none, rig()), InputError);
  Walk walk(1, 3);
  Rig other = rig();
  other.camera.width = 100;
  try {
    HandHeldCamera camera(walk, other);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("376 x 240 pixels, the rig's 100 x 240"), std::string::npos);
  }
  HandHeldOptions options;
  options.distance_m = 0;
  EXPECT_THROW(HandHeldCamera(walk, rig(), options), std::invalid_argument);
}

}  // namespace
}  // namespace vantage
