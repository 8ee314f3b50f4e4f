#include "offboard/gain/cast_kernel.h"

#include <filesystem>
#include <random>

#include <gtest/gtest.h>

#include "offboard/gain/gain_evaluator.h"
#include "offboard/gain/reference_gain.h"
#include "offboard/mapping/octomap_io.h"
#include "tests/offboard/gain/random_maps.h"
#include "tests/offboard/gain/ray_sums.h"
#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

GainOptions with_kernel(CastKernel kernel) {
  GainOptions options;
  options.kernel = name_of(kernel);
  return options;
}

std::vector<Eigen::Isometry3d> random_poses(const Region& region, int count, std::mt19937* random) {
  std::uniform_real_distribution<double> unit(0, 1);
  const Eigen::Vector3d size = region.max_corner() - region.min_corner;
  std::vector<Eigen::Isometry3d> poses;
  for (int i = 0; i < count; ++i) {
    const double reach = i % 2 == 0 ? 1 : 3;  // inside, or around
    const Eigen::Vector3d at =
        region.min_corner +
        size.cwiseProduct(Eigen::Vector3d(0.5 + reach * (unit(*random) - 0.5), 0.5 + reach * (unit(*random) - 0.5),
                                          0.5 + reach * (unit(*random) - 0.5)));
    poses.push_back(look_at(at, region.min_corner + 0.5 * size + 0.2 * (unit(*random) - 0.5) * size));
  }
  // Along the axes, exactly: from a face plane, from an edge between voxels, through voxel centres.
  Eigen::Isometry3d along = Eigen::Isometry3d::Identity();
  along.translation() = region.min_corner + Eigen::Vector3d(0.5 * size.x(), 0.5 * size.y(), -0.1);
  poses.push_back(along);
  along.translation() = region.min_corner;
  poses.push_back(along);
  return poses;
}

TEST(CastKernel, EveryKernelAndLayoutEqualsTheScalarOneOnRandomMaps) {
  const unsigned seed = 4711;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  const CameraModel camera = vga_camera();
  const std::vector<Eigen::Vector3i> sizes = {{32, 32, 32}, {1, 1, 1}, {7, 64, 9}, {65, 17, 33}, {40, 40, 40}};
  for (const Eigen::Vector3i& size : sizes) {
    // The kernels hold 32, 64 or 128 entries in registers.
    for (const int values : {8, 29, 33, 60, 70, 120}) {
      SCOPED_TRACE(testing::Message() << "size " << size.transpose() << ", " << values << " values");
      const OccupancyMap map = random_map(Region{{-0.1, 0.2, 0.05}, size, 0.01}, &random, values);
      const auto poses = random_poses(map.region(), 4, &random);
      const RayBundle rays(camera, 19, 13);  // not a multiple of a block
      const GainField flat(map, GainField::Layout::kFlat), bricks(map, GainField::Layout::kBricks);
      ASSERT_TRUE(flat.fits() && bricks.fits());
      const auto expected = GainEvaluator(rays, with_kernel(CastKernel::kScalar)).evaluate(map, flat, poses);
      for (const CastKernel kernel : available_kernels()) {
        SCOPED_TRACE(name_of(kernel));
        const GainEvaluator evaluator(rays, with_kernel(kernel));
        const auto in_flat = evaluator.evaluate(map, flat, poses), in_bricks = evaluator.evaluate(map, bricks, poses);
        for (std::size_t view = 0; view < poses.size(); ++view) {
          SCOPED_TRACE("view " + std::to_string(view));
          expect_equal_counts_and_near_sums(in_flat[view].sums, expected[view].sums);
          expect_equal_counts_and_near_sums(in_bricks[view].sums, expected[view].sums);
        }
      }
    }
  }
}

TEST(CastKernel, AgreesWithTheDoublePrecisionWalkOnClearRays) {
  const unsigned seed = 815;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  for (const double resolution : {0.01, 0.0025}) {
    const int n = resolution == 0.01 ? 100 : 400;
    const OccupancyMap map = random_map(Region{{-0.5, -0.5, -0.5}, {n, n, n / 4}, resolution}, &random);
    for (const Eigen::Vector3d& origin : {Eigen::Vector3d(0.03, 0.02, -0.37), Eigen::Vector3d(-0.9, 0.4, 0.1)}) {
      const RayBundle rays(clear_directions(map.region(), origin, 1500, 2e-3, &random));
      ASSERT_GT(rays.size(), 100U);
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation() = origin;
      const RaySums expected = cast_rays_reference(map, rays, pose);
      for (const CastKernel kernel : available_kernels()) {
        SCOPED_TRACE(name_of(kernel));
        expect_equal_counts_and_near_sums(evaluate_view(map, rays, pose, with_kernel(kernel)).sums, expected);
      }
    }
  }
}

TEST(CastKernel, MapsWithTooManyValuesAreEvaluatedExactly) {
  std::mt19937 random(99);
  const OccupancyMap map = random_map(Region{{0, 0, 0}, {24, 24, 24}, 0.01}, &random, 400);
  EXPECT_FALSE(GainField(map).fits());
  const auto poses = random_poses(map.region(), 3, &random);
  const RayBundle rays(vga_camera(), 20, 15);
  const auto gains = evaluate_views(map, rays, poses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(gains[i].sums, cast_rays_reference(map, rays, poses[i]));
  }
}

TEST(CastKernel, TheNumberOfThreadsDoesNotChangeABit) {
  std::mt19937 random(12);
  const OccupancyMap map = random_map(Region{{0, 0, 0}, {48, 48, 48}, 0.01}, &random);
  const auto poses = random_poses(map.region(), 9, &random);
  const RayBundle rays(vga_camera(), 40, 30);
  for (const CastKernel kernel : available_kernels()) {
    GainOptions options = with_kernel(kernel);
    const auto expected = evaluate_views(map, rays, poses, options);
    for (const int threads : {2, 3, 7, 64}) {
      options.threads = threads;
      const auto gains = evaluate_views(map, rays, poses, options);
      for (std::size_t i = 0; i < poses.size(); ++i) {
        EXPECT_EQ(gains[i].sums, expected[i].sums);
        EXPECT_EQ(gains[i].value, expected[i].value);
      }
    }
  }
}

TEST(CastKernel, AMapReadBackGivesTheSameGainsToTheBit) {
  OccupancyMap map(Region::cube({0, 0, 0.3}, 0.64, 0.02));
  const AnalyticScene scene;
  const auto views = ring_views();
  for (const std::size_t i : {0U, 9U, 18U}) ASSERT_TRUE(map.integrate(scene.depth_map(vga_camera(), views[i])).ok);
  const auto path = std::filesystem::temp_directory_path() / ("vantage_gain_" + std::to_string(::getpid()) + ".ot");
  write_map(path, map);
  const OccupancyMap back = read_map(path);
  std::filesystem::remove(path);
  const RayBundle rays(vga_camera(), 40, 30);
  const auto before = evaluate_views(map, rays, views), after = evaluate_views(back, rays, views);
  for (std::size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ(before[i].sums, after[i].sums);
    EXPECT_EQ(before[i].value, after[i].value);
    EXPECT_FALSE(after[i].marks_missing);
  }
}

TEST(CastKernel, BadPosesGiveAReasonAndNothingElse) {
  const OccupancyMap map(Region{{0, 0, 0}, {16, 16, 16}, 0.01});
  const RayBundle rays(vga_camera(), 8, 6);
  Eigen::Isometry3d nan = Eigen::Isometry3d::Identity(), mirrored = nan, infinite = nan;
  nan.translation().x() = NAN;
  mirrored.linear()(0, 0) = -1;
  infinite.translation().z() = INFINITY;
  for (const Eigen::Isometry3d& pose : {nan, mirrored, infinite}) {
    const ViewGain gain = evaluate_view(map, rays, pose);
    EXPECT_FALSE(gain.reason.empty());
    EXPECT_EQ(gain.sums, RaySums{});
    for (const double value : gain.value) EXPECT_EQ(value, 0);
  }
  EXPECT_TRUE(evaluate_view(map, rays, Eigen::Isometry3d::Identity()).reason.empty());
}

TEST(CastKernel, RaysThatMissTheRegionCountAsRaysAlone) {
  const OccupancyMap map(Region{{0, 0, 0}, {16, 16, 16}, 0.01});
  const RayBundle rays(vga_camera(), 8, 6);
  const ViewGain gain = evaluate_view(map, rays, look_at({-1, -1, -1}, {-2, -2, -2}));
  EXPECT_EQ(gain.sums.rays, 48);
  EXPECT_EQ(gain.sums.visits, 0);
  for (const double value : gain.value) EXPECT_EQ(value, 0);
}

TEST(CastKernel, BadOptionsAndBundlesAreRefused) {
  const OccupancyMap map;
  const RayBundle rays(vga_camera(), 8, 6);
  GainOptions options;
  options.threads = 0;
  EXPECT_THROW(evaluate_view(map, rays, Eigen::Isometry3d::Identity(), options), std::invalid_argument);
  options = {};
  options.kernel = "sse9";
  std::string why;
  EXPECT_FALSE(options.valid(&why));
  EXPECT_NE(why.find("portable"), std::string::npos);
  options = {};
  options.weights[Formulation::kEntropy] = NAN;
  EXPECT_FALSE(options.valid());
  EXPECT_THROW(RayBundle(vga_camera(), 0, 6), std::invalid_argument);
  EXPECT_THROW(RayBundle(CameraModel{}, 8, 6), std::invalid_argument);
  EXPECT_THROW(RayBundle({Eigen::Vector3d::Zero()}), std::invalid_argument);
  EXPECT_THROW(RayBundle({Eigen::Vector3d(NAN, 0, 1)}), std::invalid_argument);
}

TEST(GainField, AnUpdatedFieldEqualsAFreshOne) {
  const AnalyticScene scene;
  const auto views = ring_views();
  for (const GainField::Layout layout : {GainField::Layout::kFlat, GainField::Layout::kBricks}) {
    OccupancyMap map(Region{{-0.4, -0.4, -0.06}, {37, 41, 30}, 0.02});
    GainField field(map, layout);
    for (const std::size_t i : {0U, 1U, 9U, 18U, 33U, 40U}) {
      ASSERT_TRUE(map.integrate(scene.depth_map(vga_camera(), views[i], 0.004, static_cast<unsigned>(i))).ok);
      field.update(map);
      const GainField fresh(map, layout);
      Eigen::Vector3i v;
      for (v.z() = 0; v.z() < 30; ++v.z()) {
        for (v.y() = 0; v.y() < 41; ++v.y()) {
          for (v.x() = 0; v.x() < 37; ++v.x()) ASSERT_EQ(field.code(v), fresh.code(v)) << v.transpose();
        }
      }
      // Rays cross both in the same steps, so that not even the rounding differs.
      const GainEvaluator evaluator(RayBundle(vga_camera(), 20, 15), {});
      const auto gains = evaluator.evaluate(map, field, views), expected = evaluator.evaluate(map, fresh, views);
      for (std::size_t view = 0; view < views.size(); ++view) EXPECT_EQ(gains[view].sums, expected[view].sums);
    }
  }
}

}  // namespace
}  // namespace vantage
