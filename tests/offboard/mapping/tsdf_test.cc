#include "offboard/mapping/tsdf.h"

#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "offboard/mapping/occupancy_map.h"
#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

/// Distances of a sphere, written straight into the TSDF.
Tsdf sphere_tsdf(const Eigen::Vector3d& center, double radius) {
  Tsdf tsdf(Region::cube({0, 0, 0}, 0.4, 0.01));
  const Eigen::Vector3i bricks = (tsdf.region().size_voxels.array() + 7) / 8;
  std::size_t brick = 0;
  for (int z = 0; z < bricks.z(); ++z) {
    for (int y = 0; y < bricks.y(); ++y) {
      for (int x = 0; x < bricks.x(); ++x, ++brick) {
        Tsdf::Brick& voxels = tsdf.allocate(brick);
        for (int i = 0; i < 512; ++i) {
          const Eigen::Vector3i voxel = 8 * Eigen::Vector3i(x, y, z) + Eigen::Vector3i(i & 7, i >> 3 & 7, i >> 6);
          voxels.distance[static_cast<std::size_t>(i)] =
              static_cast<float>((tsdf.region().center(voxel) - center).norm() - radius);
          voxels.weight[static_cast<std::size_t>(i)] = 1;
        }
      }
    }
  }
  return tsdf;
}

TEST(MarchingCubes, ASphereIsClosedRoundAndFacesOutward) {
  const Eigen::Vector3d center(0.003, -0.002, 0.011);
  const PlyModel mesh = extract_mesh(sphere_tsdf(center, 0.12));
  ASSERT_GT(mesh.triangles.size(), 1000U);
  ASSERT_EQ(mesh.normals.size(), mesh.points.size());
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const Eigen::Vector3d outward = mesh.points[i].cast<double>() - center;
    EXPECT_NEAR(outward.norm(), 0.12, 2e-4);
    EXPECT_GT(outward.normalized().dot(mesh.normals[i].cast<double>()), 0.97);
  }
  // Every edge has exactly one triangle on either side, with opposite senses; Euler's number of a sphere is 2.
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(edges.count({edge.second, edge.first}) == 1);
  }
  EXPECT_EQ(static_cast<long>(mesh.points.size()) - static_cast<long>(edges.size() / 2) +
                static_cast<long>(mesh.triangles.size()),
            2);
}

TEST(MarchingCubes, EveryCaseOfACellIsPartOfAClosedSurface) {
  // Random signs on a small grid surrounded by positive values: all 256 cases and all ambiguous faces meet.
  const unsigned seed = 6;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  Tsdf tsdf(Region{{0, 0, 0}, {24, 24, 24}, 0.01});
  for (std::size_t brick = 0; brick < tsdf.brick_count(); ++brick) {
    const Eigen::Vector3i first =
        8 * Eigen::Vector3i(static_cast<int>(brick % 3), static_cast<int>(brick / 3 % 3), static_cast<int>(brick / 9));
    Tsdf::Brick& voxels = tsdf.allocate(brick);
    for (int i = 0; i < 512; ++i) {
      const Eigen::Vector3i voxel = first + Eigen::Vector3i(i & 7, i >> 3 & 7, i >> 6);
      const bool border = voxel.minCoeff() == 0 || voxel.maxCoeff() == 23;
      const float size = 0.001F + 0.01F * static_cast<float>(random() % 1000) / 1000;
      voxels.distance[static_cast<std::size_t>(i)] = border || random() % 2 == 0 ? size : -size;
      voxels.weight[static_cast<std::size_t>(i)] = 1;
    }
  }
  const PlyModel mesh = extract_mesh(tsdf);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> balance;
  for (const auto& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      ++balance[{t[k], t[(k + 1) % 3]}];
      --balance[{t[(k + 1) % 3], t[k]}];
    }
  }
  ASSERT_GT(mesh.triangles.size(), 5000U);
  for (const auto& [edge, count] : balance) ASSERT_EQ(count, 0);
}

TEST(Tsdf, MeshOfAMeasuredSceneIsOffByLessThanAMillimetreInTheMean) {
  const AnalyticScene scene;
  for (const double sigma : {0.0, 0.001}) {
    const Region region = Region::cube({0.03, 0, 0.26}, 0.64, 0.01);
    OccupancyMap map(region);
    Tsdf tsdf(region);
    const auto views = ring_views();
    for (std::size_t i = 0; i < views.size(); i += 3) {
      ASSERT_TRUE(map.integrate(scene.depth_map(vga_camera(), views[i], sigma, static_cast<unsigned>(i)), &tsdf).ok);
    }
    const PlyModel mesh = extract_mesh(tsdf);
    ASSERT_GT(mesh.points.size(), 5000U);
    double sum = 0, worst = 0;
    for (const Eigen::Vector3f& point : mesh.points) {
      const double error = scene.distance(point.cast<double>());
      sum += error;
      worst = std::max(worst, error);
    }
    const double mean = sum / static_cast<double>(mesh.points.size());
    RecordProperty("mean_error_um_" + std::to_string(static_cast<int>(sigma * 1e6)), static_cast<int>(mean * 1e6));
    EXPECT_LE(mean, 1e-3);
    EXPECT_LE(worst, 0.03);
  }
}

TEST(Tsdf, RefusesAnotherRegionThanTheMaps) {
  OccupancyMap map(Region::cube({0, 0, 0}, 0.32, 0.01));
  Tsdf tsdf(Region::cube({0, 0, 0}, 0.32, 0.02));
  const OccupancyMap before = map;
  EXPECT_FALSE(map.integrate(AnalyticScene{}.depth_map(vga_camera(), ring_views()[0]), &tsdf).ok);
  EXPECT_TRUE(map == before);
  EXPECT_THROW(Tsdf(Region{}, TsdfOptions{.truncation_voxels = 0}), std::invalid_argument);
  EXPECT_THROW(Tsdf(Region{}, TsdfOptions{.jump_share = 2}), std::invalid_argument);
}

}  // namespace
}  // namespace vantage
