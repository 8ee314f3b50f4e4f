#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "offboard/experiment/view_set_planner.h"

namespace vantage {
namespace {

TEST(SetCover, CountsWhatTwoViewsSeeOnce) {
  const std::vector<float> prior{1, 1, 0.5F};
  const std::vector<std::vector<ExpectedVoxel>> views{{{0, 1}, {1, 0.5F}}, {{0, 1}, {2, 1}}};
  SetCover cover(views, prior);
  EXPECT_DOUBLE_EQ(cover.gain(0), 1.5);
  EXPECT_DOUBLE_EQ(cover.gain(1), 1.5);
  cover.take(0);
  EXPECT_DOUBLE_EQ(cover.gain(0), 0.25);  // half of voxel 1 is left, of which it sees half
  EXPECT_DOUBLE_EQ(cover.gain(1), 0.5);   // voxel 2 alone is new
  cover.clear();
  EXPECT_DOUBLE_EQ(cover.gain(1), 1.5);
}

TEST(SetCover, LazyGreedyTakesWhatPlainGreedyTakes) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  for (int round = 0; round < 200; ++round) {
    std::vector<float> prior(40);
    for (float& p : prior) p = static_cast<float>(random() % 5) / 4;
    std::vector<std::vector<ExpectedVoxel>> views(12);
    for (auto& view : views) {
      for (std::uint32_t voxel = 0; voxel < 40; ++voxel) {
        if (random() % 3 == 0) view.push_back({voxel, static_cast<float>(1 + random() % 4) / 4});
      }
    }
    SetCover lazy(views, prior), plain(views, prior);
    std::vector<std::size_t> expected;
    double first = 0;
    while (expected.size() < 6) {
      std::size_t best = 0;
      double most = -1;
      for (std::size_t view = 0; view < views.size(); ++view) {
        const bool taken = std::find(expected.begin(), expected.end(), view) != expected.end();
        if (taken || plain.gain(view) <= most) continue;
        most = plain.gain(view);
        best = view;
      }
      if (expected.empty()) first = plain.gain(best);
      if (plain.gain(best) <= 0 || plain.gain(best) < 0.1 * first) break;
      plain.take(best);
      expected.push_back(best);
    }
    ASSERT_EQ(lazy.take_greedily(6, 0.1), expected) << "round " << round;
  }
}

/// A wall of occupied voxels at x = 10 of a 20-voxel cube; behind it nothing is observed, before it all is free.
class BehindAWall : public testing::Test {
 protected:
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
  RayBundle axis_{std::vector<Eigen::Vector3d>{Eigen::Vector3d::UnitZ()}};
};

TEST_F(BehindAWall, SightEndsAtTheWall) {
  ExpectedViews expected(map_, {});
  EXPECT_TRUE(expected.see(axis_, at(-0.3)).empty());
}

TEST_F(BehindAWall, SightHalvesWithEachUnknownVoxel) {
  ExpectedViews expected(map_, {});
  const std::vector<ExpectedVoxel> seen = expected.see(axis_, at(0.5));
  ASSERT_EQ(seen.size(), 5U);  // 1, 1/2, 1/4, 1/8, 1/16; the next would be below 0.05
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i].voxel, 19 - i + 20 * (10 + 20 * 10));
    EXPECT_FLOAT_EQ(seen[i].probability, std::ldexp(1.0F, -static_cast<int>(i)));
  }
  const double d_max = map_.sensor_model().occlusion_range_m;
  EXPECT_NEAR(expected.prior()[seen[0].voxel], 1 - 0.09 / d_max, map_.mark_step_m() / d_max);
}

TEST_F(BehindAWall, TheSetGoesRoundTheWall) {
  const CameraModel camera{64, 48, 60, 60, 31.5, 23.5, Distortion::kNone, {}};
  const std::vector<CandidateView> open{{1, at(-0.35)}, {2, at(0.55)}, {3, at(-0.4)}};
  const std::vector<std::int64_t> visited{0};
  ViewSetPlanner planner;
  EXPECT_EQ(planner.choose({map_, camera, open, visited, Eigen::Vector3d(-0.3, 0.105, 0.105)}), 1U);
}

TEST_F(BehindAWall, WithNothingToSeeItGoesToTheNearest) {
  const CameraModel camera{64, 48, 60, 60, 31.5, 23.5, Distortion::kNone, {}};
  const std::vector<CandidateView> open{{1, at(-0.5)}, {3, at(-0.4)}};
  const std::vector<std::int64_t> visited{0};
  ViewSetPlanner planner;
  EXPECT_EQ(planner.choose({OccupancyMap(map_.region()), camera, open, visited, {-0.3, 0.105, 0.105}}), 1U);
}

}  // namespace
}  // namespace vantage
