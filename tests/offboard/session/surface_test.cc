#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "offboard/session/map_check.h"
#include "offboard/session/surface_cloud.h"
#include "offboard/session/surface_coverage.h"

namespace vantage {
namespace {

TEST(SurfaceCoverage, EqualsBruteForceHoweverThePointsCome) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(-0.1F, 0.1F);
    std::vector<Eigen::Vector3f> surface, cloud;
    for (int i = 0; i < 2000; ++i) surface.emplace_back(place(random), place(random), place(random));
    for (int i = 0; i < 1000; ++i) cloud.emplace_back(place(random), place(random), place(random));
    int covered = 0;
    for (const auto& point : surface) {
      covered += std::any_of(cloud.begin(), cloud.end(), [&](const auto& c) { return (c - point).norm() < 0.008F; });
    }
    SurfaceCoverage at_once(surface), in_parts(surface);
    at_once.add(cloud);
    in_parts.add({cloud.begin(), cloud.begin() + 400});
    in_parts.add({cloud.begin() + 300, cloud.end()});
    EXPECT_DOUBLE_EQ(at_once.share(), covered / 2000.0);
    EXPECT_DOUBLE_EQ(in_parts.share(), covered / 2000.0);
    EXPECT_GT(covered, 100);
    EXPECT_LT(covered, 1900);
  }
}

/// A camera at the origin that looks along +z at a wall 0.5 m away.
DepthMap wall() {
  DepthMap map;
  map.camera = {40, 30, 40, 40, 19.5, 14.5, Distortion::kNone, {}};
  map.depth_m.assign(40 * 30, 0.5F);
  map.sigma_m.assign(40 * 30, 0.001F);
  map.state.assign(40 * 30, DepthState::kConverged);
  return map;
}

TEST(SurfaceCloud, HoldsOnePointACellOnTheWall) {
  const Region region = Region::cube({0, 0, 0.5}, 0.32, 0.01);
  SurfaceCloud cloud(region, {.spacing_m = 0.02});
  EXPECT_GT(cloud.add(wall()).size(), 100u);
  for (const Eigen::Vector3f& point : cloud.points()) {
    EXPECT_NEAR(point.z(), 0.5, 1e-6);
    EXPECT_LE(point.head<2>().cwiseAbs().maxCoeff(), 0.16F);  // the region's half edge
  }
  EXPECT_TRUE(cloud.add(wall()).empty());  // the same cells again
}

TEST(SurfaceCloud, NormalsOfASlantedPlaneStandOnIt) {
  // The plane z = 0.5 + x tan(30 deg), seen from the origin: its normal towards the camera is (sin 30, 0, -cos 30).
  DepthMap map = wall();
  map.camera.fx = map.camera.fy = 160;
  for (int i = 0; i < 40 * 30; ++i) {
    const double x_over_z = (i % 40 - 19.5) / 160;
    map.depth_m[static_cast<std::size_t>(i)] = static_cast<float>(0.5 / (1 - x_over_z * std::tan(M_PI / 6)));
  }
  map.T_world_camera.linear() = Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()).toRotationMatrix();
  SurfaceCloud cloud(Region::cube({0, 0, 0.5}, 1.28, 0.01), {});
  cloud.add(map);
  ASSERT_EQ(cloud.normals().size(), cloud.points().size());
  const Eigen::Vector3d expected = map.T_world_camera.linear() * Eigen::Vector3d(0.5, 0, -std::sqrt(0.75));
  for (const Eigen::Vector3f& normal : cloud.normals()) EXPECT_LT((normal.cast<double>() - expected).norm(), 0.02);
}

TEST(SurfaceCloud, LeavesOutWhatIsUncertainFarOrNoSurface) {
  const Region region = Region::cube({0, 0, 0.5}, 0.32, 0.01);
  DepthMap uncertain = wall(), edges = wall();
  uncertain.sigma_m.assign(uncertain.sigma_m.size(), 0.02F);
  edges.state.assign(edges.state.size(), DepthState::kEdge);
  SurfaceCloud cloud(region, {.largest_sigma_m = 0.01}), near(region, {.max_range_m = 0.4});
  EXPECT_TRUE(cloud.add(uncertain).empty());
  EXPECT_TRUE(cloud.add(edges).empty());
  EXPECT_TRUE(near.add(wall()).empty());
}

TEST(MapCheck, FindsAWallThatIsThereAndMissesOneThatIsNot) {
  OccupancyMap map(Region::cube({0, 0, 0.5}, 1.28, 0.02));
  ASSERT_TRUE(map.integrate(wall()).ok);
  MapCheck same;
  check_depth_map(map, wall(), 2, &same);
  EXPECT_EQ(same.points, 40 * 30);
  EXPECT_DOUBLE_EQ(same.share(), 1);
  EXPECT_EQ(same.cameras, 1);
  EXPECT_EQ(same.cameras_in_occupied, 0);
  DepthMap elsewhere = wall();
  elsewhere.depth_m.assign(elsewhere.depth_m.size(), 0.4F);  // five voxels before the wall
  MapCheck other;
  check_depth_map(map, elsewhere, 2, &other);
  EXPECT_EQ(other.near_occupied, 0);
  DepthMap inside = wall();
  inside.T_world_camera.translation().z() = 0.5;
  check_depth_map(map, inside, 2, &other);
  EXPECT_EQ(other.cameras_in_occupied, 1);
}

}  // namespace
}  // namespace vantage
