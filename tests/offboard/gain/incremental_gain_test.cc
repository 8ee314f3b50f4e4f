#include "offboard/gain/incremental_gain.h"

#include <gtest/gtest.h>

#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

TEST(IncrementalGain, EqualsTheFullEvaluationToTheBitAfterEveryImage) {
  const AnalyticScene scene;
  const auto views = ring_views();
  const RayBundle rays(vga_camera(), 40, 30);
  for (const char* kernel : {"scalar", "portable", ""}) {
    GainOptions options;
    options.kernel = kernel;
    OccupancyMap map(Region::cube({0, 0, 0.56}, 1.28, 0.02));
    IncrementalGain incremental(map, rays, views, options);
    for (const std::size_t i : {0U, 1U, 2U, 17U, 33U, 34U, 34U, 34U, 34U}) {
      ASSERT_TRUE(map.integrate(scene.depth_map(vga_camera(), views[i], 0.001, static_cast<unsigned>(i))).ok);
      const auto gains = incremental.update(), expected = evaluate_views(map, rays, views, options);
      for (std::size_t view = 0; view < views.size(); ++view) {
        ASSERT_EQ(gains[view].sums, expected[view].sums) << "image " << i << ", view " << view;
        ASSERT_EQ(gains[view].value, expected[view].value);
        ASSERT_EQ(gains[view].marks_missing, expected[view].marks_missing);
      }
    }
    incremental.update();
    EXPECT_EQ(incremental.recast_share(), 0);
  }
}

TEST(IncrementalGain, EqualsTheFullEvaluationInBricksToo) {
  // 256 voxels an edge: more than the flat field takes, so that bricks and joined cubes come and go.
  const AnalyticScene scene;
  const auto views = ring_views();
  const RayBundle rays(vga_camera(), 32, 24);
  for (const char* kernel : {"scalar", ""}) {
    GainOptions options;
    options.kernel = kernel;
    OccupancyMap map(Region::cube({0, 0, 0.56}, 1.28, 0.005));
    IncrementalGain incremental(map, rays, views, options);
    for (const std::size_t i : {0U, 1U, 17U, 34U, 34U, 34U}) {
      ASSERT_TRUE(map.integrate(scene.depth_map(vga_camera(), views[i], 0.001, static_cast<unsigned>(i))).ok);
      const auto gains = incremental.update(), expected = evaluate_views(map, rays, views, options);
      for (std::size_t view = 0; view < views.size(); ++view) {
        ASSERT_EQ(gains[view].sums, expected[view].sums) << "image " << i << ", view " << view;
      }
    }
    // One voxel in the middle of free space breaks a joined cube: rays far from the voxel's own brick pass it too.
    const Eigen::Vector3i voxel(128, 40, 200);
    for (const float log_odds : {2.0F, -3.4F}) {
      ASSERT_TRUE(map.set_log_odds(voxel, log_odds));
      const auto gains = incremental.update(), expected = evaluate_views(map, rays, views, options);
      for (std::size_t view = 0; view < views.size(); ++view) {
        ASSERT_EQ(gains[view].sums, expected[view].sums) << "log-odds " << log_odds << ", view " << view;
      }
    }
  }
}

TEST(IncrementalGain, FollowsSingleVoxelsThroughRegionsOfAnySize) {
  const unsigned seed = 5;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  const RayBundle rays(vga_camera(), 20, 15);
  for (const Eigen::Vector3i& size : {Eigen::Vector3i(9, 17, 33), Eigen::Vector3i(300, 40, 260)}) {
    const Region region{{-0.2, -0.2, 0}, size, 0.01};
    OccupancyMap map(region);
    std::vector<Eigen::Isometry3d> views = {look_at({-1, -1, 0.7}, region.center(size / 2)),
                                            look_at(region.center(size / 3), region.center(size / 2))};
    Eigen::Isometry3d bad = Eigen::Isometry3d::Identity();
    bad.translation().x() = NAN;
    views.push_back(bad);
    IncrementalGain incremental(map, rays, views);
    for (int step = 0; step < 40; ++step) {
      const Eigen::Vector3i voxel(static_cast<int>(random() % static_cast<unsigned>(size.x())),
                                  static_cast<int>(random() % static_cast<unsigned>(size.y())),
                                  static_cast<int>(random() % static_cast<unsigned>(size.z())));
      ASSERT_TRUE(map.set_log_odds(voxel, step % 3 == 0 ? 2.0F : -1.5F));
      const auto gains = incremental.update(), expected = evaluate_views(map, rays, views);
      for (std::size_t view = 0; view < views.size(); ++view) {
        ASSERT_EQ(gains[view].sums, expected[view].sums);
        ASSERT_EQ(gains[view].reason, expected[view].reason);
      }
      if (step > 0) {
        EXPECT_LT(incremental.recast_share(), 0.5);  // one voxel concerns few rays
      }
    }
  }
}

}  // namespace
}  // namespace vantage
