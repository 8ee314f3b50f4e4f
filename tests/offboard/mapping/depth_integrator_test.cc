#include "offboard/mapping/depth_integrator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "offboard/mapping/depth_lookup.h"
#include "offboard/mapping/voxel_projection.h"
#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

Region experiment_region(double resolution_m) { return Region::cube({0, 0, 0.56}, 1.28, resolution_m); }

std::vector<Eigen::Vector3d> points_of(const DepthMap& map) {
  std::vector<Eigen::Vector3d> points;
  std::size_t i = 0;
  for (int v = 0; v < map.camera.height; ++v) {
    for (int u = 0; u < map.camera.width; ++u, ++i) {
      if (map.state[i] != DepthState::kConverged) continue;
      points.push_back(map.T_world_camera *
                       (static_cast<double>(map.depth_m[i]) *
                        Eigen::Vector3d((u - map.camera.cx) / map.camera.fx, (v - map.camera.cy) / map.camera.fy, 1)));
    }
  }
  return points;
}

/// A flat wall at depth 1 m across the whole image, seen from the origin along +z (world = camera).
DepthMap wall(float depth_m, float sigma_m) {
  DepthMap map;
  map.camera = {160, 120, 120, 120, 79.5, 59.5, Distortion::kNone, {}};
  const std::size_t pixels = 160 * 120;
  map.depth_m.assign(pixels, depth_m);
  map.sigma_m.assign(pixels, sigma_m);
  map.state.assign(pixels, DepthState::kConverged);
  return map;
}

/// Columns of voxels along +z about the optical axis; 2 cm voxels, the first centre at z = 0.01.
OccupancyMap axis_map(const SensorModel& model = {}) {
  return OccupancyMap(Region{{-0.04, -0.04, 0}, {4, 4, 80}, 0.02}, model);
}

TEST(DepthIntegrator, AgreesWithTheExactWalkOnTheExperimentsScene) {
  const AnalyticScene scene;
  for (const std::size_t view : {0U, 20U, 37U}) {
    const DepthMap image = scene.depth_map(vga_camera(), ring_views()[view]);
    OccupancyMap projective(experiment_region(0.01)), exact(experiment_region(0.01));
    ASSERT_TRUE(projective.integrate(image).ok);
    ASSERT_TRUE(exact.integrate_points(image.T_world_camera.translation(), points_of(image)).ok);
    std::int64_t same = 0, both_known_but_different = 0, occupied_in_one = 0;
    const Eigen::Vector3i size = exact.region().size_voxels;
    double mark_error = 0;
    std::int64_t marks = 0;
    Eigen::Vector3i v;
    for (v.z() = 0; v.z() < size.z(); ++v.z()) {
      for (v.y() = 0; v.y() < size.y(); ++v.y()) {
        for (v.x() = 0; v.x() < size.x(); ++v.x()) {
          const VoxelState a = projective.state(v), b = exact.state(v);
          same += a == b;
          both_known_but_different += a != b && a != VoxelState::kUnobserved && b != VoxelState::kUnobserved;
          occupied_in_one += (a == VoxelState::kOccupied) != (b == VoxelState::kOccupied);
          if (a == VoxelState::kUnobserved && b == a && projective.has_mark(v) && exact.has_mark(v)) {
            mark_error += std::abs(projective.occlusion_distance_m(v) - exact.occlusion_distance_m(v));
            ++marks;
          }
        }
      }
    }
    const double agreement = static_cast<double>(same) / static_cast<double>(exact.region().voxel_count());
    RecordProperty("agreement_ppm_" + std::to_string(view), static_cast<int>(agreement * 1e6));
    EXPECT_GT(agreement, 0.997);
    EXPECT_LE(both_known_but_different, 20);  // end points on a face, by rounding
    EXPECT_LE(occupied_in_one, 20);
    ASSERT_GT(marks, 1000);
    EXPECT_LT(mark_error / static_cast<double>(marks), 0.006);
  }
}

TEST(DepthIntegrator, AWallFreesHitsAndMarksByHandCalculation) {
  OccupancyMap map = axis_map();
  const IntegrationResult result = map.integrate(wall(1.01F, 0.001F));  // the centre of voxel 50
  ASSERT_TRUE(result.ok) << result.error;
  for (int z = 0; z < 80; ++z) {
    const Eigen::Vector3i voxel(2, 2, z);
    const double center = 0.01 + 0.02 * z;
    if (z < 2) continue;  // so near, the voxel is wider than the image
    EXPECT_EQ(map.state(voxel), z < 50   ? VoxelState::kFree
                                : z > 50 ? VoxelState::kUnobserved
                                         : VoxelState::kOccupied)
        << z;
    // Straight ahead the distance along the ray is the difference of depths, to a hundredth.
    const double behind = center - 1.01;
    if (z > 50 && behind < 0.29) {
      EXPECT_NEAR(map.occlusion_distance_m(voxel), behind, 0.002) << z;
    }
    if (behind > 0.31 || z <= 50) {
      EXPECT_FALSE(map.has_mark(voxel)) << z;
    }
  }
  EXPECT_NEAR(map.probability({2, 2, 50}), 0.8, 1e-6);
  EXPECT_NEAR(map.probability({2, 2, 20}), 0.2, 1e-6);
  // OctoMap's log-odds arithmetic: clamped at 0.97 and 0.03 after three images.
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(map.integrate(wall(1.01F, 0.001F)).ok);
  EXPECT_NEAR(map.probability({2, 2, 50}), 0.97, 1e-6);
  EXPECT_NEAR(map.probability({2, 2, 20}), 0.03, 1e-6);
}

TEST(DepthIntegrator, AVaguePixelHitsLessAndFreesLess) {
  const double full = std::log(4.0);
  const std::vector<std::pair<float, double>> cases = {{0.005F, full},      {0.0099F, full},     {0.0101F, full / 2},
                                                       {0.0199F, full / 2}, {0.0201F, full / 4}, {0.0399F, full / 4},
                                                       {0.0401F, 0.0}};
  for (const auto& [sigma, log_odds] : cases) {  // of voxels of 0.02 m
    OccupancyMap map = axis_map();
    ASSERT_TRUE(map.integrate(wall(1.01F, sigma)).ok);
    EXPECT_NEAR(map.log_odds({2, 2, 50}), log_odds, 1e-5) << sigma;
    // Free up to two sigma before the surface, and no farther.
    for (int z = 2; z < 50; ++z) {
      const double center = 0.01 + 0.02 * z, limit = 1.01 - 2 * static_cast<double>(sigma);
      if (std::abs(center - limit) < 1e-6) continue;
      EXPECT_EQ(map.observed({2, 2, z}), center < limit) << z << " at sigma " << sigma;
    }
  }
}

TEST(DepthIntegrator, OnlyConvergedPixelsSpeak) {
  for (const DepthState state :
       {DepthState::kInvalid, DepthState::kEdge, DepthState::kUpdating, DepthState::kDiverged}) {
    DepthMap map = wall(1.01F, 0.001F);
    map.state.assign(map.state.size(), state);
    OccupancyMap occupancy = axis_map();
    ASSERT_TRUE(occupancy.integrate(map).ok);
    EXPECT_TRUE(occupancy == axis_map());
    EXPECT_FALSE(occupancy.has_marks());
  }
}

TEST(DepthIntegrator, BeyondTheRangeARayFreesUpToItAndHitsNothing) {
  SensorModel model;
  model.max_range_m = 0.8;
  OccupancyMap map = axis_map(model);
  ASSERT_TRUE(map.integrate(wall(1.01F, 0.001F)).ok);
  EXPECT_EQ(map.counts().occupied, 0);
  EXPECT_EQ(map.counts().marked, 0);
  EXPECT_EQ(map.state({2, 2, 38}), VoxelState::kFree);        // centre at 0.77
  EXPECT_EQ(map.state({2, 2, 41}), VoxelState::kUnobserved);  // at 0.83
}

TEST(DepthIntegrator, AThinPostBeforeAWallIsNotSeenThrough) {
  // A post one pixel wide at 0.5 m, wall at 1 m. The post's voxels hold measured points: hits win over misses.
  DepthMap image = wall(1.01F, 0.001F);
  for (std::size_t v = 0; v < 120; ++v) image.depth_m[v * 160 + 80] = 0.51F;
  OccupancyMap map = axis_map();
  ASSERT_TRUE(map.integrate(image).ok);
  EXPECT_EQ(map.state({2, 2, 25}), VoxelState::kOccupied);
}

TEST(DepthIntegrator, WholeBrickAnswersEqualVoxelByVoxelOnes) {
  // A region shifted by less than a brick cuts other bricks from the same voxels: a voxel's update must not depend on
  // the brick it lies in, but for the size of the footprint, which is taken at the brick's middle.
  const AnalyticScene scene;
  const DepthMap image = scene.depth_map(vga_camera(), ring_views()[20]);
  Region one = Region::cube({0, 0, 0.4}, 0.64, 0.0025), other = one;
  one.size_voxels = other.size_voxels = Eigen::Vector3i(128, 128, 128);
  other.min_corner -= 3 * 0.0025 * Eigen::Vector3d::Ones();
  other.size_voxels.array() += 3;
  OccupancyMap a(one), b(other);
  ASSERT_TRUE(a.integrate(image).ok);
  ASSERT_TRUE(b.integrate(image).ok);
  std::int64_t different = 0;
  Eigen::Vector3i v;
  for (v.z() = 0; v.z() < 128; ++v.z()) {
    for (v.y() = 0; v.y() < 128; ++v.y()) {
      for (v.x() = 0; v.x() < 128; ++v.x()) {
        const Eigen::Vector3i w = v + Eigen::Vector3i::Constant(3);
        different += a.level(v) != b.level(w) || std::abs(a.mark(v) - b.mark(w)) > 1;
      }
    }
  }
  EXPECT_LE(different, 128 * 128 * 128 / 2000);
}

/// What the image says for certain of a voxel, in double precision: from its centre's pixel, and from windows narrower
/// and wider than its own.
struct Certain {
  bool free = false, not_free = false, marked = false, not_marked = false;

  Certain(const OccupancyMap& map, const DepthMap& image, const Eigen::Vector3i& voxel, DepthLookup* lookup) {
    constexpr double kSlack = 1e-4;  // m
    const CameraModel& camera = image.camera;
    const Eigen::Vector3d p = image.T_world_camera.inverse() * map.region().center(voxel);
    const double pixels = map.region().resolution_m * camera.fx / p.z();  // of a voxel's edge
    const double u = camera.fx * p.x() / p.z() + camera.cx, v = camera.fy * p.y() / p.z() + camera.cy;
    const double far = 2 * pixels + 2;  // a voxel's centre may lie beside the image by less
    if (p.z() < 0.1 || u < -far || v < -far || u > camera.width + far || v > camera.height + far) {
      free = marked = false;
      not_free = not_marked = p.z() < 0 || p.z() >= 0.1;
      return;
    }
    // Pixels in doubt, at most one from the centre's, lie in the wide window.
    const int column = static_cast<int>(std::clamp(std::round(u), 0.0, camera.width - 1.0));
    const int row = static_cast<int>(std::clamp(std::round(v), 0.0, camera.height - 1.0));
    const auto at = static_cast<std::size_t>(row * camera.width + column);
    const bool on_pixel = std::abs(u - column) < 0.49 && std::abs(v - row) < 0.49;
    const double wide = static_cast<double>(lookup->free_limit_in_window(static_cast<int>(pixels) + 3)[at]);
    const double near = static_cast<double>(lookup->free_limit()[at]),
                 surface = static_cast<double>(lookup->surface()[at]);
    const double slant = p.norm() / p.z(), range = map.sensor_model().occlusion_range_m;
    free = on_pixel && p.z() < near - kSlack;
    not_free = p.z() > wide + kSlack;
    marked = on_pixel && not_free && p.z() > surface + kSlack && p.z() > wide + kSlack &&
             (p.z() - surface) * slant < range - kSlack;
    not_marked = on_pixel && (p.z() < surface - kSlack || (p.z() - std::max(wide, surface)) * slant > range + kSlack);
  }
};

TEST(DepthIntegrator, WhatIsSaidOfManyBricksAtOnceHoldsForEveryVoxel) {
  const unsigned seed = 5;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 6; ++i) {
    SCOPED_TRACE("image " + std::to_string(i));
    // From outside, or from within the region: parts of it lie behind the camera then.
    const Eigen::Vector3d eye =
        (i % 2 == 0 ? 0.8 : 0.35) * Eigen::Vector3d(unit(random), unit(random), 0.5) + Eigen::Vector3d(0, 0, 0.4);
    const Eigen::Vector3d target(0.1 * unit(random), 0.1 * unit(random), 0.1);
    const DepthMap image = AnalyticScene{}.depth_map(vga_camera(), look_at(eye, target), 0.001, seed);
    OccupancyMap map(Region{{-0.4, -0.35, -0.03}, {133, 121, 90}, 0.006});
    ASSERT_TRUE(map.integrate(image).ok);
    DepthLookup lookup;
    lookup.prepare(image, map.sensor_model());
    std::array<std::int64_t, 4> certain{};
    Eigen::Vector3i v;
    for (v.z() = 0; v.z() < 90; ++v.z()) {
      for (v.y() = 0; v.y() < 121; ++v.y()) {
        for (v.x() = 0; v.x() < 133; ++v.x()) {
          const Certain of(map, image, v, &lookup);
          const VoxelState state = map.state(v);
          const bool hit = map.observed(v) && map.log_odds(v) > 0;
          ASSERT_TRUE(!of.free || hit || state == VoxelState::kFree) << v.transpose();
          ASSERT_TRUE(!of.not_free || state != VoxelState::kFree) << v.transpose();
          ASSERT_TRUE(!of.marked || hit || map.has_mark(v)) << v.transpose();
          ASSERT_TRUE(!of.not_marked || !map.has_mark(v)) << v.transpose();
          certain[0] += of.free;
          certain[1] += of.not_free;
          certain[2] += of.marked;
          certain[3] += of.not_marked;
        }
      }
    }
    for (const std::int64_t voxels : certain) EXPECT_GT(voxels, 1000);
  }
}

TEST(DepthIntegrator, EveryInstructionSetGivesTheSameVerdictsToTheBit) {
  const unsigned seed = 8;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<ProjectionKernels> kernels = {projection_kernels_portable(), best_projection_kernels()};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) kernels.push_back(projection_kernels_avx2());
#endif
  std::vector<float> free_limit, surface;
  for (int i = 0; i < 64 * 48; ++i) {
    const bool known = unit(random) < 0.8F;
    free_limit.push_back(known ? 0.2F + unit(random) : 0);
    surface.push_back(known ? free_limit.back() + 0.01F : INFINITY);
  }
  free_limit.push_back(0);
  surface.push_back(INFINITY);
  for (int trial = 0; trial < 300; ++trial) {
    VoxelProjection p;
    p.fx = p.fy = 60;
    p.cx = 32;
    p.cy = 24;
    p.width = 64;
    p.height = 48;
    p.margin = static_cast<float>(trial % 5);
    p.free_limit = free_limit.data();
    p.surface = surface.data();
    p.occlusion_range_m = 0.3F;
    p.marks_per_metre = 254 / 0.3F;
    for (std::size_t a = 0; a < 3; ++a) {
      p.first[a] = unit(random) - 0.5F;
      p.step_x[a] = 0.02F * (unit(random) - 0.5F);
      p.step_y[a] = 0.02F * (unit(random) - 0.5F);
      p.step_z[a] = 0.02F * (unit(random) - 0.5F);
    }
    p.first[2] += 0.6F;
    VoxelVerdicts expected;
    kernels[0].classify_voxels(p, &expected);
    for (const ProjectionKernels& kernel : kernels) {
      VoxelVerdicts verdicts;
      kernel.classify_voxels(p, &verdicts);
      ASSERT_EQ(verdicts.missed, expected.missed);
      ASSERT_EQ(verdicts.mark, expected.mark);
      ASSERT_EQ(verdicts.missed_count, expected.missed_count);
      ASSERT_EQ(verdicts.mark_count, expected.mark_count);
    }
  }
  std::vector<float> sigma(surface.size(), 0.003F), squares, expected_free(64), expected_surface(64), expected_max(61);
  std::vector<std::uint8_t> state;
  for (int i = 0; i < 64; ++i) {
    squares.push_back(unit(random));
    state.push_back(static_cast<std::uint8_t>(random() % 5));
  }
  for (std::size_t i = 0; i < kernels.size(); ++i) {
    std::vector<float> free(64), seen(64), largest(61);
    kernels[i].prepare_row(
        {free_limit.data(), sigma.data(), state.data(), squares.data(), 1.2F, 0.9F, 2, free.data(), seen.data(), 64});
    kernels[i].max_of_three(free_limit.data(), free_limit.data() + 70, free_limit.data() + 500, 61, largest.data());
    if (i == 0) {
      expected_free = free;
      expected_surface = seen;
      expected_max = largest;
    }
    ASSERT_EQ(free, expected_free);
    ASSERT_EQ(seen, expected_surface);
    ASSERT_EQ(largest, expected_max);
  }
}

TEST(DepthIntegrator, BadInputIsRefusedAndTheMapUnchanged) {
  OccupancyMap map = axis_map();
  ASSERT_TRUE(map.integrate(wall(1.01F, 0.001F)).ok);
  const OccupancyMap before = map;
  std::vector<DepthMap> bad(9, wall(1.01F, 0.001F));
  bad[0].T_world_camera.translation().x() = NAN;
  bad[1].T_world_camera.linear() *= -1;
  bad[2].camera.width = bad[2].camera.height = 0;
  bad[3].sigma_m[7] = 0;
  bad[4].sigma_m[7] = -0.01F;
  bad[5].depth_m[7] = NAN;
  bad[6].depth_m.clear();
  bad[7].camera.fx = -1;
  bad[8].depth_m[7] = -1;
  for (std::size_t i = 0; i < bad.size(); ++i) {
    const IntegrationResult result = map.integrate(bad[i]);
    EXPECT_FALSE(result.ok) << i;
    EXPECT_FALSE(result.error.empty()) << i;
    EXPECT_TRUE(map == before) << i;
  }
}

TEST(DepthIntegrator, MemoryGrowsWithWhatWasTouched) {
  OccupancyMap map(Region::cube({0, 0, 0.64}, 2.56, 0.0025));  // 1024^3
  const std::size_t empty = map.memory_bytes();
  EXPECT_LT(empty, std::size_t{40} << 20);
  CameraModel camera = vga_camera();
  ASSERT_TRUE(map.integrate(AnalyticScene{}.depth_map(camera, ring_views()[0])).ok);
  EXPECT_GT(map.counts().free, 1000000);
  EXPECT_LT(map.memory_bytes() - empty, std::size_t{120} << 20);  // 1024^3 voxels of 3 bytes are 3 GiB
}

}  // namespace
}  // namespace vantage
