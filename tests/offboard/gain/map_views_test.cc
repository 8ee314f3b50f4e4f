#include "offboard/gain/map_views.h"

#include <gtest/gtest.h>

#include "offboard/gain/view_gain.h"
#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

TEST(MapViews, AnUntouchedMapOffersNone) { EXPECT_TRUE(views_from_map(OccupancyMap()).empty()); }

TEST(MapViews, AWallSeenFromOneSideIsLookedAtFromTheOther) {
  // A wall in the plane x = 16, free space before it (x < 16), nothing known behind.
  OccupancyMap map(Region{{0, 0, 0}, {32, 32, 32}, 0.01});
  for (int z = 0; z < 32; ++z) {
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 16; ++x) ASSERT_TRUE(map.set_log_odds({x, y, z}, -2));
      ASSERT_TRUE(map.set_log_odds({16, y, z}, 2));
    }
  }
  MapViewOptions options;
  options.standoff_m = 0.4;
  const auto views = views_from_map(map, options);
  ASSERT_FALSE(views.empty());
  for (const MapView& view : views) {
    EXPECT_TRUE(view.rear_side);
    EXPECT_NEAR(view.target.x(), 0.175, 1e-9);  // the voxels just behind the wall
    EXPECT_NEAR(view.T_world_camera.translation().x(), 0.575, 1e-9);
    EXPECT_NEAR(view.T_world_camera.linear().col(2).x(), -1, 1e-9);
    EXPECT_TRUE(is_rigid(view.T_world_camera));
  }
}

TEST(MapViews, OfASceneAreFreeAimedOrderedAndRepeatable) {
  OccupancyMap map(Region::cube({0, 0, 0.56}, 1.28, 0.02));
  const AnalyticScene scene;
  for (const std::size_t i : {0U, 18U}) ASSERT_TRUE(map.integrate(scene.depth_map(vga_camera(), ring_views()[i])).ok);
  MapViewOptions options;
  options.min_camera_z_m = 0.1;
  const auto views = views_from_map(map, options), again = views_from_map(map, options);
  ASSERT_GT(views.size(), 10U);
  ASSERT_LE(views.size(), 48U);
  ASSERT_EQ(views.size(), again.size());
  const RayBundle rays(vga_camera(), 40, 30);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Eigen::Isometry3d& pose = views[i].T_world_camera;
    EXPECT_TRUE(pose.matrix() == again[i].T_world_camera.matrix());
    EXPECT_TRUE(is_rigid(pose));
    EXPECT_GE(pose.translation().z(), 0.1);
    EXPECT_NEAR((views[i].target - pose.translation()).norm(), options.standoff_m, 1e-9);
    const Eigen::Vector3d in_camera = pose.inverse() * views[i].target;
    EXPECT_NEAR(in_camera.head<2>().norm(), 0, 1e-9);
    EXPECT_GT(in_camera.z(), 0);
    Eigen::Vector3i voxel;
    if (map.region().voxel_at(pose.translation(), &voxel)) {
      EXPECT_EQ(map.state(voxel), VoxelState::kFree);
    }
    if (i > 0) {
      EXPECT_LE(views[i].score, views[i - 1].score);
    }
    EXPECT_GT(evaluate_view(map, rays, pose)[Formulation::kUnobservedVoxel], 0);
  }
}

TEST(MapViews, BadOptionsAreNamed) {
  std::string why;
  EXPECT_FALSE((MapViewOptions{.standoff_m = NAN}.valid(&why)));
  EXPECT_NE(why.find("standoff_m"), std::string::npos);
  EXPECT_THROW(views_from_map(OccupancyMap(), MapViewOptions{.max_views = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace vantage
