// Every formulation against the plain implementation on OctoMap's computeRayKeys.

#include <gtest/gtest.h>

#include "offboard/gain/cast_kernel.h"
#include "offboard/gain/reference_gain.h"
#include "offboard/gain/view_gain.h"
#include "tests/offboard/gain/octomap_gain.h"
#include "tests/offboard/gain/random_maps.h"
#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

/// OctoMap takes points in single precision: rays closer than this to an edge between voxels, in voxels, are left out.
constexpr double kMargin = 2e-4;

void expect_oracle(const OccupancyMap& map, const Eigen::Vector3d& origin, const std::vector<Eigen::Vector3d>& rays,
                   const std::string& kernel) {
  SCOPED_TRACE(kernel);
  OctomapGain oracle(map);
  const auto expected = oracle.evaluate(origin, rays);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = origin;
  GainOptions options;
  options.kernel = kernel;
  const ViewGain gain = evaluate_view(map, RayBundle(rays), pose, options);
  EXPECT_EQ(gain.sums.visits, oracle.visits());
  for (const Formulation f : kAllFormulations) {
    if (f == Formulation::kCombined) continue;
    const double value = expected[static_cast<std::size_t>(f)];
    EXPECT_NEAR(gain[f], value, 1e-5 * std::abs(value) + 1e-12) << name_of(f);
  }
  EXPECT_DOUBLE_EQ(gain[Formulation::kCombined],
                   30 * gain[Formulation::kAverageEntropy] + gain[Formulation::kRearSideEntropy]);
}

Eigen::Vector3d float_point(const Eigen::Vector3d& p) {
  const Eigen::Vector3f rounded = p.cast<float>();
  return rounded.cast<double>();
}

TEST(OctomapOracle, AgreesOnRandomMaps) {
  const unsigned seed = 77;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> around(-0.6, 0.6);
  for (int trial = 0; trial < 8; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Region region{{-0.16, -0.2, -0.12}, {32, 40, 24}, 0.01};
    const OccupancyMap map = random_map(region, &random);
    const Eigen::Vector3d origin =
        float_point(Eigen::Vector3d(around(random), around(random), around(random)) * (trial % 2 == 0 ? 0.2 : 1));
    const auto rays = clear_directions(region, origin, 600, kMargin, &random);
    ASSERT_GT(rays.size(), 200U);
    for (const CastKernel kernel : available_kernels()) expect_oracle(map, origin, rays, std::string(name_of(kernel)));
  }
}

TEST(OctomapOracle, AgreesOnAnIntegratedScene) {
  const unsigned seed = 78;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  OccupancyMap map(Region::cube({0, 0, 0.56}, 1.28, 0.02));
  const AnalyticScene scene;
  const auto views = ring_views();
  for (const std::size_t i : {0U, 3U, 20U, 37U}) {
    ASSERT_TRUE(map.integrate(scene.depth_map(vga_camera(), views[i], 0.001, static_cast<unsigned>(i))).ok);
  }
  for (const std::size_t i : {5U, 11U, 24U, 45U}) {
    const Eigen::Vector3d origin = float_point(views[i].translation() + Eigen::Vector3d(0.0037, 0.0021, 0.0013));
    const auto rays = clear_directions(map.region(), origin, 2000, kMargin, &random);
    ASSERT_GT(rays.size(), 1500U);
    for (const CastKernel kernel : available_kernels()) expect_oracle(map, origin, rays, std::string(name_of(kernel)));
  }
}

TEST(OctomapOracle, TheWrongSignIsFarFromTheOracle) {
  // The oracle's product over P instead of 1 - P, on the same rays: it must not pass for ours.
  std::mt19937 random(79);
  const Region region{{-0.16, -0.16, -0.16}, {32, 32, 32}, 0.01};
  const OccupancyMap map = random_map(region, &random);
  const Eigen::Vector3d origin(-0.3, 0.05, 0.02);
  double right = 0, wrong = 0;
  const auto rays = clear_directions(region, origin, 500, kMargin, &random);
  for (const Eigen::Vector3d& ray : rays) {
    double visibility = 1, wrong_visibility = 1;
    walk_ray(region.to_voxels(origin), ray, region.size_voxels, [&](const Eigen::Vector3i& v, double, double) {
      const double p = map.probability(v), h = entropy_of_probability(p);
      right += visibility * h;
      wrong += wrong_visibility * h;
      visibility *= 1 - p;
      wrong_visibility *= p;
      return map.state(v) != VoxelState::kOccupied;
    });
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = origin;
  const double ours = evaluate_view(map, RayBundle(rays), pose)[Formulation::kOcclusionAware];
  EXPECT_NEAR(ours, right, 1e-5 * right);
  EXPECT_GT(std::abs(ours - wrong), 0.05 * right);
}

}  // namespace
}  // namespace vantage
