#include "offboard/lookahead/map_window.h"

#include <gtest/gtest.h>

#include "calib/look_at.h"

namespace vantage {
namespace {

constexpr int kWidth = MapWindow::kWidth;

const CameraModel& camera() {
  static const CameraModel kCamera{752, 480, 448, 448, 375.5, 239.5, Distortion::kNone, {}};
  return kCamera;
}

std::size_t index(int x, int y, int z) { return static_cast<std::size_t>(x + kWidth * (y + kWidth * z)); }

/// A wall across the window at x = 24 of it, up to 0.2 m; free before it, marked behind.
class AWallInTheMap : public testing::Test {
 protected:
  AWallInTheMap() {
    for (int z = 64; z < 84; ++z) {
      for (int y = 40; y < 88; ++y) {
        map_.set_log_odds({64, y, z}, 3);
        for (int x = 65; x < 88; ++x) map_.set_log_odds({x, y, z}, -3);
        for (int x = 50; x < 64; ++x) map_.set_occlusion_distance({x, y, z}, 0.01 * (64 - x));
      }
    }
    map_.set_has_marks(true);
  }
  OccupancyMap map_;
  const Eigen::Vector3d foot_{0, 0, 0};
  const Eigen::Isometry3d front_ = look_at({0.6, 0.005, 0.1}, {0, 0.005, 0.1}),
                          back_ = look_at({-0.6, 0.005, 0.1}, {0, 0.005, 0.1});
};

TEST_F(AWallInTheMap, StandsOnTheGroundAroundTheFocus) {
  const MapWindow window(map_, camera(), std::vector{front_}, foot_);
  EXPECT_EQ(window.min_corner(), Eigen::Vector3i(64 - kWidth / 2, 64 - kWidth / 2, 64));
  const auto& numbers = window.numbers();
  ASSERT_EQ(numbers.size(), MapWindow::kVoxels);
  EXPECT_EQ(numbers[index(24, 24, 5)][MapWindow::kOccupied], 127);
  EXPECT_EQ(numbers[index(30, 24, 5)][MapWindow::kFree], 127);
  EXPECT_EQ(numbers[index(20, 24, 5)][MapWindow::kFree], 0);
  EXPECT_EQ(numbers[index(20, 24, 5)][MapWindow::kOccupied], 0);
  EXPECT_EQ(numbers[index(20, 24, 5)][MapWindow::kProbability], 64) << "unobserved";
  EXPECT_EQ(numbers[index(30, 24, 20)][MapWindow::kAboveGround], 64) << "half-way up";
}

TEST_F(AWallInTheMap, TheNearerBehindASurfaceTheMore) {
  const MapWindow window(map_, camera(), std::vector{front_}, foot_);
  const auto behind = [&](int x) { return window.numbers()[index(x, 24, 5)][MapWindow::kBehind]; };
  EXPECT_GT(behind(23), behind(15));
  EXPECT_GT(behind(15), 0);
  EXPECT_EQ(behind(30), 0) << "before it";
}

TEST_F(AWallInTheMap, TellsWhoLookedAtAVoxelAndFromWhomItIsHidden) {
  const MapWindow window(map_, camera(), std::vector{front_, back_}, foot_);
  const MapWindow::Numbers &before = window.numbers()[index(40, 24, 10)], &behind = window.numbers()[index(8, 24, 10)];
  for (const MapWindow::Numbers* voxel : {&before, &behind}) {
    EXPECT_EQ((*voxel)[MapWindow::kLookedAt], 16) << "one of eight";
    EXPECT_EQ((*voxel)[MapWindow::kViews], 16) << "two of sixteen";
  }
  EXPECT_GT(before[MapWindow::kLookedFrom], 120) << "from the front";
  EXPECT_LT(before[MapWindow::kHiddenFrom], -60) << "hidden from the back, one of two";
  EXPECT_LT(behind[MapWindow::kLookedFrom], -120);
  EXPECT_GT(behind[MapWindow::kHiddenFrom], 60);
}

TEST_F(AWallInTheMap, BesideThePictureNobodyLooks) {
  const MapWindow window(map_, camera(), std::vector{look_at({0.6, 0.005, 0.1}, {1.2, 0.005, 0.1})}, foot_);
  for (const MapWindow::Numbers& voxel : window.numbers()) ASSERT_EQ(voxel[MapWindow::kLookedAt], 0);
}

TEST(MapWindow, OutsideTheRegionAllIsZero) {
  const OccupancyMap map(Region{{-0.1, -0.1, 0}, {20, 20, 20}, 0.01});
  const MapWindow window(map, camera(), std::vector{look_at({0.6, 0.005, 0.1}, {0, 0.005, 0.1})}, {0, 0, 0.1});
  EXPECT_EQ(window.numbers()[index(2, 2, 2)], MapWindow::Numbers{});
  EXPECT_NE(window.numbers()[index(24, 24, 2)], MapWindow::Numbers{});
}

TEST(Focus, IsThePointThatAllViewsFace) {
  CylinderViewsOptions options;
  options.axis_foot = {0.2, -0.1, 0};
  const Eigen::Vector3d focus = focus_of(cylinder_views(options), Eigen::Vector3d::Zero());
  EXPECT_NEAR((focus - Eigen::Vector3d(0.2, -0.1, options.target_height_m)).norm(), 0, 1e-9);
}

TEST(Focus, OfParallelViewsOrNoneIsTheOther) {
  const Eigen::Vector3d other(1, 2, 3);
  EXPECT_EQ(focus_of({}, other), other);
  std::vector<CandidateView> views(2);
  views[1].T_world_camera.translation() = Eigen::Vector3d(0.5, 0, 0);
  EXPECT_EQ(focus_of(views, other), other);
}

}  // namespace
}  // namespace vantage
