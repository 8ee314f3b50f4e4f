#include "offboard/mapping/occupancy_map.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/offboard/mapping/analytic_scene.h"
#include "tests/offboard/mapping/octomap_oracle.h"

namespace vantage {
namespace {

const double kLogOdds4 = std::log(4.0);  // of 0.8

Region small_region() { return Region::cube({0, 0, 0}, 0.32, 0.01); }

TEST(Region, EachVoxelHasItsPlaceInAnArrayOfAll) {
  const Region region{{0, 0, 0}, {7, 5, 3}, 0.01};
  std::uint32_t place = 0;
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < 7; ++x, ++place) {
        ASSERT_EQ(region.index_of({x, y, z}), place);
        ASSERT_EQ(region.voxel_of(place), Eigen::Vector3i(x, y, z));
      }
    }
  }
  const Region largest{{0, 0, 0}, Eigen::Vector3i::Constant(Region::kMaxSizeVoxels), 0.01};
  const Eigen::Vector3i last = Eigen::Vector3i::Constant(Region::kMaxSizeVoxels - 1);
  EXPECT_EQ(largest.voxel_of(largest.index_of(last)), last);
}

TEST(OccupancyMap, StartsUnobservedWithLn2NatsAVoxel) {
  const OccupancyMap map(small_region());
  EXPECT_EQ(map.region().voxel_count(), 32 * 32 * 32);
  EXPECT_NEAR(map.entropy_nats(), 32 * 32 * 32 * std::log(2.0), 1e-6);
  EXPECT_EQ(map.counts().unobserved, 32 * 32 * 32);
  EXPECT_EQ(map.state({0, 0, 0}), VoxelState::kUnobserved);
  EXPECT_EQ(map.probability({31, 31, 31}), 0.5);
  EXPECT_EQ(map.occlusion_distance_m({1, 2, 3}), std::numeric_limits<double>::infinity());
}

TEST(OccupancyMap, StateFollowsThePapersThresholdsWithEpsilon) {
  const auto log_odds = [](double p) { return std::log(p / (1 - p)); };
  OccupancyMap map(small_region());
  const std::vector<std::pair<double, VoxelState>> cases = {
      {0.8, VoxelState::kOccupied},  {0.8 - 5e-7, VoxelState::kOccupied}, {0.8 - 2e-6, VoxelState::kUncertain},
      {0.2, VoxelState::kFree},      {0.2 + 5e-7, VoxelState::kFree},     {0.2 + 2e-6, VoxelState::kUncertain},
      {0.5, VoxelState::kUncertain}, {0.97, VoxelState::kOccupied},       {0.03, VoxelState::kFree}};
  for (const auto& [probability, state] : cases) {
    ASSERT_TRUE(map.set_log_odds({3, 4, 5}, static_cast<float>(log_odds(probability))));
    EXPECT_EQ(map.state({3, 4, 5}), state) << probability;
    EXPECT_NEAR(map.probability({3, 4, 5}), probability, 1e-7);
  }
}

TEST(OccupancyMap, ObservedAtLogOddsZeroIsNotUnobserved) {
  OccupancyMap map(small_region());
  ASSERT_TRUE(map.set_log_odds({1, 1, 1}, 0));
  EXPECT_TRUE(map.observed({1, 1, 1}));
  EXPECT_EQ(map.state({1, 1, 1}), VoxelState::kUncertain);
  EXPECT_FALSE(map == OccupancyMap(small_region()));
  map.set_unobserved({1, 1, 1});
  EXPECT_TRUE(map == OccupancyMap(small_region()));
}

TEST(OccupancyMap, EntropyIsTheSumOfTheVoxels) {
  OccupancyMap map(small_region());
  ASSERT_TRUE(map.set_log_odds({1, 1, 1}, static_cast<float>(kLogOdds4)));
  ASSERT_TRUE(map.set_log_odds({20, 9, 31}, static_cast<float>(-kLogOdds4)));
  // H(0.8) = 0.8 ln 1.25 + 0.2 ln 5
  const double known = 0.8 * std::log(1.25) + 0.2 * std::log(5.0);
  EXPECT_NEAR(map.entropy_nats(), (32 * 32 * 32 - 2) * std::log(2.0) + 2 * known, 1e-6);
}

TEST(OccupancyMap, RegionsOfAnySizeCountTheirOwnVoxelsAlone) {
  for (const int n : {1, 2, 7, 8, 9, 15, 16, 17, 33}) {
    Region region{{0, 0, 0}, {n, 3, n + 1}, 0.01};
    OccupancyMap map(region);
    for (int x = 0; x < n; ++x) ASSERT_TRUE(map.set_log_odds({x, 2, n}, 2));
    EXPECT_EQ(map.counts().occupied, n);
    EXPECT_EQ(map.counts().unobserved, region.voxel_count() - n);
    EXPECT_EQ(map.occupied_centers().size(), static_cast<std::size_t>(n));
  }
}

TEST(OccupancyMap, ClearedMapEqualsANewOne) {
  OccupancyMap map(small_region());
  ASSERT_TRUE(map.set_log_odds({1, 1, 1}, 1.0F));
  map.set_occlusion_distance({2, 2, 2}, 0.1);
  EXPECT_TRUE(map.has_marks());
  map.clear();
  EXPECT_TRUE(map == OccupancyMap(small_region()));
  EXPECT_FALSE(map.has_marks());
}

TEST(OccupancyMap, ACopyGrowsOnItsOwn) {
  const Region region{{0, 0, 0}, {8 * 70, 8 * 70, 8}, 0.01};  // more bricks than a piece of the storage holds
  OccupancyMap map(region), twin(region);
  const auto fill = [](OccupancyMap* to, int from, int end) {
    for (int y = from; y < end; ++y) {
      for (int x = 0; x < 70; ++x)
        ASSERT_TRUE(to->set_log_odds({8 * x + 3, 8 * y + 1, 5}, static_cast<float>(x - y) / 40));
    }
  };
  fill(&map, 0, 30);
  OccupancyMap copy = map;
  fill(&copy, 30, 70);
  fill(&twin, 0, 70);
  EXPECT_TRUE(copy == twin);
  EXPECT_FALSE(map == twin);
  fill(&map, 30, 70);
  EXPECT_TRUE(map == twin);
}

TEST(OccupancyMap, MarksKeepTheDistanceToHalfAStep) {
  OccupancyMap map(small_region());
  const double step = map.mark_step_m();
  for (double d = 0; d <= 0.3; d += 0.0007) {
    map.set_occlusion_distance({2, 2, 2}, d);
    EXPECT_NEAR(map.occlusion_distance_m({2, 2, 2}), d, step / 2 + 1e-12);
  }
}

TEST(OccupancyMap, RefusesBadRegionsAndModels) {
  EXPECT_THROW(OccupancyMap(Region::cube({0, 0, 0}, 0.004, 0.01)), std::invalid_argument);
  EXPECT_THROW(OccupancyMap(Region::cube({0, 0, 0}, 20, 0.01)), std::invalid_argument);
  EXPECT_THROW(OccupancyMap(Region::cube({NAN, 0, 0}, 1, 0.01)), std::invalid_argument);
  EXPECT_THROW(OccupancyMap(Region::cube({0, 0, 0}, 1, 0)), std::invalid_argument);
  EXPECT_THROW(OccupancyMap(Region::cube({0, 0, 0}, 1, -0.01)), std::invalid_argument);
  for (const SensorModel& model :
       {SensorModel{.hit_probability = 0.5}, SensorModel{.miss_probability = 0}, SensorModel{.clamp_min = 0.3},
        SensorModel{.clamp_max = 1}, SensorModel{.max_range_m = NAN}, SensorModel{.occlusion_range_m = 0},
        SensorModel{.free_margin_sigmas = -1}}) {
    EXPECT_THROW(OccupancyMap(small_region(), model), std::invalid_argument);
  }
  OccupancyMap map(small_region());
  EXPECT_FALSE(map.set_log_odds({0, 0, 0}, NAN));
  EXPECT_FALSE(map.set_log_odds({0, 0, 0}, INFINITY));
  EXPECT_TRUE(map == OccupancyMap(small_region()));
}

/// Random clouds from random sensors, in and around the region, some points beyond the range.
TEST(OccupancyMap, ExactWalkEqualsOctoMapsInsertPointCloudVoxelByVoxel) {
  const unsigned seed = 20260101;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> inside(-0.15, 0.15), around(-0.5, 0.5);
  std::int64_t compared = 0, observed = 0;
  for (int trial = 0; trial < 12; ++trial) {
    SensorModel model;
    model.max_range_m = trial % 3 == 0 ? 0.35 : 1.5;
    OccupancyMap map(small_region(), model);
    octomap::OcTree tree = make_octree(map.region(), model);
    for (int cloud = 0; cloud < 6; ++cloud) {
      // Coordinates are OctoMap's floats, so that both see the same numbers.
      const bool near = cloud % 2 == 0;
      const auto number = [&](bool narrow) {
        return static_cast<double>(static_cast<float>(narrow ? inside(random) : around(random)));
      };
      const Eigen::Vector3d origin(number(near), number(near), number(near));
      std::vector<Eigen::Vector3d> points;
      octomap::Pointcloud oracle_points;
      for (int i = 0; i < 300; ++i) {
        const bool narrow = i % 4 != 0;
        points.emplace_back(number(narrow), number(narrow), number(narrow));
        oracle_points.push_back(to_point3d(points.back()));
      }
      ASSERT_TRUE(map.integrate_points(origin, points).ok);
      tree.insertPointCloud(oracle_points, to_point3d(origin), model.max_range_m);
    }
    const Eigen::Vector3i size = map.region().size_voxels;
    for (int z = 0; z < size.z(); ++z) {
      for (int y = 0; y < size.y(); ++y) {
        for (int x = 0; x < size.x(); ++x) {
          const octomap::OcTreeNode* node = node_at(tree, map.region(), {x, y, z});
          ASSERT_EQ(map.observed({x, y, z}), node != nullptr)
              << "trial " << trial << " at " << x << " " << y << " " << z;
          ++compared;
          if (node == nullptr) continue;
          ++observed;
          ASSERT_NEAR(map.log_odds({x, y, z}), node->getLogOdds(), 1e-5) << x << " " << y << " " << z;
        }
      }
    }
  }
  EXPECT_EQ(compared, 12 * 32 * 32 * 32);
  EXPECT_GT(observed, compared / 10);
}

TEST(OccupancyMap, ExactWalkRefusesNumbersThatAreNotFinite) {
  OccupancyMap map(small_region());
  const OccupancyMap before = map;
  EXPECT_FALSE(map.integrate_points({NAN, 0, 0}, {{0, 0, 0}}).ok);
  const IntegrationResult result = map.integrate_points({0, 0, 0}, {{0.1, 0, 0}, {INFINITY, 0, 0}});
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.error.find("point 1"), std::string::npos);
  EXPECT_TRUE(map == before);
}

TEST(OccupancyMap, ExactWalkMarksTheVoxelsBehindAnEndPoint) {
  // One ray along x: from x = 0.005 to a surface at 0.105 (voxel 10), d_max 0.05.
  SensorModel model;
  model.occlusion_range_m = 0.05;
  OccupancyMap map(Region{{0, 0, 0}, {20, 1, 1}, 0.01}, model);
  ASSERT_TRUE(map.integrate_points({0.005, 0.005, 0.005}, {{0.105, 0.005, 0.005}}).ok);
  for (int x = 0; x < 20; ++x) {
    const Eigen::Vector3i voxel(x, 0, 0);
    EXPECT_EQ(map.state(voxel), x < 10   ? VoxelState::kFree
                                : x > 10 ? VoxelState::kUnobserved
                                         : VoxelState::kOccupied)
        << x;
    if (x >= 11 && x <= 14) {
      EXPECT_NEAR(map.occlusion_distance_m(voxel), 0.01 * (x - 10), map.mark_step_m()) << x;
    } else if (x != 15) {  // exactly d_max behind: either
      EXPECT_FALSE(map.has_mark(voxel)) << x;
    }
  }
}

}  // namespace
}  // namespace vantage
