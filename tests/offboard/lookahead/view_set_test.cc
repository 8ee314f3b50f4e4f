#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "offboard/lookahead/view_set_planner.h"

namespace vantage {
namespace {

/// A wall of occupied voxels at x = 10 of a 20-voxel cube; behind it nothing is observed, before it all is free.
class BehindAWall : public testing::Test {
 protected:
  static constexpr float kSurface = 0.1F;

  BehindAWall() : map_(Region{{0, 0, 0}, {20, 20, 20}, 0.01}) {
    for (int z = 0; z < 20; ++z) {
      for (int y = 0; y < 20; ++y) {
        for (int x = 0; x < 10; ++x) map_.set_log_odds({x, y, z}, -3);
        map_.set_log_odds({10, y, z}, 3);
        for (int x = 11; x < 20; ++x) map_.set_occlusion_distance({x, y, z}, 0.01 * (x - 10));
      }
    }
    map_.set_has_marks(true);
  }
  static Eigen::Isometry3d at(double x) { return look_at({x, 0.105, 0.105}, {0.105, 0.105, 0.105}); }
  OccupancyMap map_;
  ExpectedSurface surface_{{0, 0, 0}, {20, 20, 20}, std::vector<float>(8000, kSurface), {}};  // the same everywhere
  RayBundle axis_{std::vector<Eigen::Vector3d>{Eigen::Vector3d::UnitZ()}};
};

TEST_F(BehindAWall, SightEndsAtTheWall) {
  ExpectedViews expected(map_, surface_, {});
  EXPECT_TRUE(expected.see(axis_, at(-0.3)).empty());
}

TEST_F(BehindAWall, SightFallsByWhatEachVoxelProbablyHolds) {
  ExpectedViews expected(map_, surface_, {});
  const std::vector<ExpectedVoxel> seen = expected.see(axis_, at(0.5));
  ASSERT_EQ(seen.size(), 9U);  // 19 to 11: all behind the wall, up to it
  double sight = 1;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    ASSERT_EQ(seen[i].voxel, 19 - i + 20 * (10 + 20 * 10));
    const ExpectedViewOptions options;
    // No free voxel tells where they face, but for the last: within two of it is free space, on the wall's other side.
    EXPECT_NEAR(seen[i].probability, sight * (i < 8 ? options.detected_unknown : options.detected_averted), 1e-5) << i;
    sight *= 1 - options.opacity * static_cast<double>(kSurface);
  }
}

TEST_F(BehindAWall, WhatFacesTheCameraIsMeasuredAndWhatTurnsAwayIsNot) {
  // The space behind the unknown is seen through, but for a last layer before the wall.
  for (int z = 0; z < 20; ++z) {
    for (int y = 0; y < 20; ++y) {
      for (int x = 12; x < 20; ++x) map_.set_log_odds({x, y, z}, -3);
    }
  }
  const auto probability = [&](const Eigen::Vector3d& from) {
    ExpectedViews expected(map_, surface_, {});
    const std::vector<ExpectedVoxel> seen = expected.see(axis_, look_at(from, {0.115, 0.105, 0.105}));
    return seen.empty() ? -1.0 : static_cast<double>(seen.front().probability);
  };
  const ExpectedViewOptions options;
  EXPECT_NEAR(probability({0.6, 0.105, 0.105}), options.detected_facing, 1e-3);
  const double slant = probability({0.115 + 0.3, 0.105 + 0.4, 0.105});  // at the cosine 0.6
  EXPECT_NEAR(slant, options.detected_facing * (1 - std::pow(0.4, options.slant_exponent)), 0.02);
}

TEST_F(BehindAWall, ALeanIsByTheDirectionToTheCamera) {
  constexpr std::size_t kAlongX = 1;
  surface_.lean.assign(8000, Lean{});
  for (Lean& lean : surface_.lean) lean[kAlongX] = 0.2F;
  ExpectedViewOptions options;
  options.detected_unknown = 0.3;  // so that nothing is clipped
  ExpectedViews leaning(map_, surface_, {}, options);
  const ExpectedSurface level{surface_.min_corner, surface_.size, surface_.amount, {}};
  ExpectedViews upright(map_, level, {}, options);
  const auto times = [&](const Eigen::Isometry3d& from) {
    const std::vector<ExpectedVoxel> with = leaning.see(axis_, from), without = upright.see(axis_, from);
    EXPECT_FALSE(with.empty());
    EXPECT_EQ(with.front().voxel, without.front().voxel);
    return static_cast<double>(with.front().probability / without.front().probability);
  };
  EXPECT_NEAR(times(at(0.6)), std::exp(0.2), 1e-3);
  EXPECT_NEAR(times(look_at({0.155, 0.6, 0.105}, {0.155, 0.105, 0.105})), 1, 1e-3);
}

TEST_F(BehindAWall, OutsideWhatTheNetworkLookedAtNothingIsExpected) {
  const ExpectedSurface part{{-2, 0, 0}, {15, 20, 20}, std::vector<float>(6000, kSurface), {}};
  const ExpectedViews expected(map_, part, {});
  const auto at_voxel = [&](int x) { return expected.prior()[static_cast<std::size_t>(x + 20 * (10 + 20 * 10))]; };
  EXPECT_EQ(at_voxel(12), kSurface);
  EXPECT_EQ(at_voxel(13), 0);
}

TEST_F(BehindAWall, WhatWasMissedIsMissedFromNearThereAndNotFromElsewhere) {
  const std::uint32_t voxel = 19 + 20 * (10 + 20 * 10);
  const std::vector<TakenView> taken{{{0.6, 0.105, 0.105}, {{voxel, 0.8F, Eigen::Vector3f::Zero()}}}};
  ExpectedViews before(map_, surface_, {}), after(map_, surface_, taken);
  const auto share_left = [&](const Eigen::Vector3d& from) {
    const Eigen::Isometry3d T_world_camera = look_at(from, {0.195, 0.105, 0.105});
    const auto of = [&](ExpectedViews* views) {
      for (const ExpectedVoxel& seen : views->see(axis_, T_world_camera)) {
        if (seen.voxel == voxel) return static_cast<double>(seen.probability);
      }
      return 0.0;
    };
    return of(&after) / of(&before);
  };
  EXPECT_NEAR(share_left({0.6, 0.105, 0.105}), 0.2, 1e-3) << "from the same place";
  EXPECT_NEAR(share_left({0.195, 0.6, 0.105}), 1, 1e-3) << "at a right angle";
  const double between = share_left({0.495, 0.405, 0.105});
  EXPECT_GT(between, 0.9) << "at 45 degrees";
  EXPECT_LT(between, 1);
}

TEST_F(BehindAWall, AViewFromFartherOffSeesNoFewerVoxels) {
  const CameraModel camera{752, 480, 450, 450, 375.5, 239.5, Distortion::kNone, {}};
  ExpectedViews expected(map_, surface_, {});
  for (const double x : {0.6, 1.0, 1.4}) {
    const std::vector<ExpectedVoxel> seen = expected.see(expected.rays_for(camera, at(x)), at(x));
    const auto of_the_last_layer = std::count_if(seen.begin(), seen.end(), [](const ExpectedVoxel& voxel) {
      return voxel.voxel % 20 == 19 && voxel.voxel / 400 > 0;  // without the ground
    });
    EXPECT_EQ(of_the_last_layer, 19 * 20) << x;
  }
}

TEST_F(BehindAWall, SurfaceIsExpectedInWhatIsUnknownAndNotInTheGround) {
  const ExpectedViews expected(map_, surface_, {});
  const auto at_voxel = [&](int x, int y, int z) {
    return expected.prior()[static_cast<std::size_t>(x + 20 * (y + 20 * z))];
  };
  EXPECT_EQ(at_voxel(12, 10, 10), kSurface);
  EXPECT_EQ(at_voxel(5, 10, 10), 0) << "free";
  EXPECT_EQ(at_voxel(10, 10, 10), 0) << "seen already";
  EXPECT_EQ(at_voxel(12, 10, 0), 0) << "ground";
}

TEST_F(BehindAWall, MoreThanCertainIsExpectedNowhere) {
  surface_.amount.assign(8000, 1.7F);
  const ExpectedViews expected(map_, surface_, {});
  for (const float prior : expected.prior()) ASSERT_LT(prior, 1);
}

TEST(VoxelSurroundings, NearIsUpToTwentyCentimetresFromWhatWasSeen) {
  OccupancyMap map(Region{{0, 0, 0}, {64, 8, 8}, 0.01});
  map.set_log_odds({2, 4, 5}, 3);
  const VoxelSurroundings surroundings(map, std::vector<float>(64 * 8 * 8, 1), 0);
  const auto near = [&](int x) { return surroundings.near()[static_cast<std::size_t>(x + 64 * (4 + 8 * 5))] != 0; };
  EXPECT_FALSE(near(2)) << "known";
  EXPECT_TRUE(near(3));
  EXPECT_TRUE(near(22));
  EXPECT_FALSE(near(23));
}

TEST(VoxelSurroundings, SurfaceFacesTheFreeVoxels) {
  // Free space above and beside a block of unknown voxels.
  OccupancyMap map(Region{{0, 0, 0}, {32, 32, 32}, 0.01});
  for (int z = 0; z < 32; ++z) {
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 32; ++x) {
        if (x >= 20 || z >= 20) map.set_log_odds({x, y, z}, -3);
      }
    }
  }
  map.set_log_odds({12, 16, 12}, 3);
  const auto index = [](int x, int y, int z) { return static_cast<std::size_t>(x + 32 * (y + 32 * z)); };
  std::vector<float> expected(32 * 32 * 32, 1);
  expected[index(12, 16, 19)] = 0;
  const VoxelSurroundings surroundings(map, expected, 0);
  EXPECT_GT(surroundings.facing()[index(10, 16, 19)][2], 95) << "up";
  EXPECT_GT(surroundings.facing()[index(19, 16, 10)][0], 95) << "aside";
  const std::array<std::int8_t, 3> nowhere{};
  EXPECT_EQ(surroundings.facing()[index(10, 16, 10)], nowhere) << "inside";
  EXPECT_EQ(surroundings.facing()[index(12, 16, 19)], nowhere) << "where nothing is expected";
}

TEST_F(BehindAWall, WhatViewsFailedToMeasureIsNotLookedForForEver) {
  // Two places see the same from behind, one sees from the side. Nothing comes of the first: the map stays.
  const CameraModel camera{64, 48, 60, 60, 31.5, 23.5, Distortion::kNone, {}};
  const Eigen::Vector3d target(0.15, 0.105, 0.105);
  std::vector<Eigen::Isometry3d> poses{look_at({0.5, -0.3, 0.105}, target)};
  const CandidateView behind{1, at(0.55)}, beside_it{2, at(0.56)}, side{3, look_at({0.15, -0.4, 0.105}, target)};
  std::vector<std::int64_t> visited{0};
  ViewSetPlanner planner;
  const std::vector<CandidateView> first{behind, side}, then{beside_it, side};
  ASSERT_EQ(planner.choose({map_, camera, first, visited, poses}).place, 0U);
  visited.push_back(behind.id);
  poses.push_back(behind.T_world_camera);
  ASSERT_EQ(ViewSetPlanner().choose({map_, camera, then, visited, poses}).place, 0U) << "a planner that took no view";
  int again = 0;
  for (; again < 8 && planner.choose({map_, camera, then, visited, poses}).place == 0; ++again) {
    visited.push_back(beside_it.id);
    poses.push_back(beside_it.T_world_camera);
  }
  EXPECT_LT(again, 8);
}

TEST_F(BehindAWall, TheSetGoesRoundTheWall) {
  const CameraModel camera{64, 48, 60, 60, 31.5, 23.5, Distortion::kNone, {}};
  const std::vector<CandidateView> open{{1, at(-0.35)}, {2, at(0.55)}, {3, at(-0.4)}};
  const std::vector<std::int64_t> visited{0};
  const std::vector<Eigen::Isometry3d> poses{at(-0.3)};
  ViewSetPlanner planner;
  EXPECT_EQ(planner.choose({map_, camera, open, visited, poses}).place, 1U);
}

TEST_F(BehindAWall, MetresGrowDearWithTheWayThatTheRunHasMade) {
  const CameraModel camera{64, 48, 60, 60, 31.5, 23.5, Distortion::kNone, {}};
  const std::vector<CandidateView> open{{1, at(-0.35)}, {2, at(0.55)}};
  const auto price_after = [&](double way_m) {
    const std::vector<std::int64_t> visited{0, 3, 4};
    const std::vector<Eigen::Isometry3d> poses{at(-0.3), at(-0.3 - way_m / 2), at(-0.3)};
    const ChosenView chosen = ViewSetPlanner().choose({map_, camera, open, visited, poses});
    const ScoredView& most = chosen.scores[1];  // its gain is the reference, for this planner's first choice
    EXPECT_GT(most.gain, chosen.scores[0].gain);
    return (1 - most.utility) / most.cost;
  };
  const ViewSetOptions options;
  constexpr double kDistance = 0.45;  // mean, of the two views to the region's middle: they face no one point
  const double price = options.way_weight / kDistance, dear_after_m = options.dear_after * kDistance;
  EXPECT_NEAR(price_after(0), price, 1e-6);
  EXPECT_NEAR(price_after(0.99 * dear_after_m), price, 1e-6);
  EXPECT_NEAR(price_after(2 * dear_after_m), 4 * price, 1e-6);
}

TEST_F(BehindAWall, WhatIsBelowTheGroundIsNotExpected) {
  ExpectedViewOptions options;
  options.ground_m = 0.1;
  const ExpectedViews expected(map_, surface_, {}, options);
  const auto at_voxel = [&](int z) { return expected.prior()[static_cast<std::size_t>(12 + 20 * (10 + 20 * z))]; };
  EXPECT_EQ(at_voxel(9), 0);
  EXPECT_EQ(at_voxel(11), kSurface);
}

TEST_F(BehindAWall, WithNothingToSeeItGoesToTheNearest) {
  const CameraModel camera{64, 48, 60, 60, 31.5, 23.5, Distortion::kNone, {}};
  const std::vector<CandidateView> open{{1, at(-0.5)}, {3, at(-0.4)}};
  const std::vector<std::int64_t> visited{0};
  const std::vector<Eigen::Isometry3d> poses{at(-0.3)};
  ViewSetPlanner planner;
  EXPECT_EQ(planner.choose({OccupancyMap(map_.region()), camera, open, visited, poses}).place, 1U);
}

}  // namespace
}  // namespace vantage
