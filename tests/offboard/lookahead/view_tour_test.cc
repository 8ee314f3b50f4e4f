#include "offboard/lookahead/view_tour.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <utility>

#include <gtest/gtest.h>

namespace vantage {
namespace {

using Views = std::vector<std::vector<ExpectedVoxel>>;

struct RandomScene {
  explicit RandomScene(std::mt19937& random, std::size_t count) {
    std::normal_distribution<float> normal;
    for (int i = 0; i < 60; ++i) prior.push_back(static_cast<float>(random() % 100) / 100);
    for (std::size_t i = 0; i < count; ++i) {
      positions.emplace_back(normal(random), normal(random), normal(random));
      std::vector<ExpectedVoxel>& view = views.emplace_back();
      for (std::uint32_t voxel = 0; voxel < prior.size(); ++voxel) {
        const Eigen::Vector3f direction(normal(random), normal(random), normal(random));
        if (random() % 2 == 0)
          view.push_back({voxel, static_cast<float>(random() % 100) / 100, direction.normalized()});
      }
    }
  }
  std::vector<float> prior;
  std::vector<Eigen::Vector3d> positions;
  Views views;
};

double worth(const std::vector<std::size_t>& tour, const Eigen::Vector3d& from, const RandomScene& scene,
             double reference, const ViewTourOptions& options, SetCover* cover) {
  cover->clear();
  double sum = 0, discount = 1;
  Eigen::Vector3d at = from;
  for (const std::size_t view : tour) {
    sum += discount * (cover->gain(view) / reference - options.way_weight_per_m * (scene.positions[view] - at).norm());
    cover->take(view);
    at = scene.positions[view];
    discount *= options.discount;
  }
  return sum;
}

/// The largest worth of all tours that can't go on: as long as they may be, or no other view within what is left.
double best_of_all(const std::vector<std::size_t>& views, double way_left, const Eigen::Vector3d& from,
                   const RandomScene& scene, double reference, const ViewTourOptions& options, SetCover* cover) {
  const Eigen::Vector3d at = views.empty() ? from : scene.positions[views.back()];
  double best = -std::numeric_limits<double>::infinity();
  bool ends = true;
  for (std::size_t view = 0; view < scene.positions.size() && views.size() < options.length; ++view) {
    const double leg = (scene.positions[view] - at).norm();
    if (leg > way_left || std::find(views.begin(), views.end(), view) != views.end()) continue;
    ends = false;
    std::vector<std::size_t> longer = views;
    longer.push_back(view);
    best = std::max(best, best_of_all(longer, way_left - leg, from, scene, reference, options, cover));
  }
  return ends ? worth(views, from, scene, reference, options, cover) : best;
}

class BestTour : public testing::TestWithParam<double> {};  // way beyond the nearest view

TEST_P(BestTour, IsTheBestOfAllWhenAllAreKept) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  ViewTourOptions options;
  options.length = 3;
  options.kept = 1000;
  options.way_weight_per_m = 0.1;
  const Eigen::Vector3d from(1, 0, 0);
  for (int round = 0; round < 20; ++round) {
    const RandomScene scene(random, 7);
    SetCover cover(scene.views, scene.prior);
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& position : scene.positions) nearest = std::min(nearest, (position - from).norm());
    options.most_way_m = nearest + GetParam();
    const std::vector<std::size_t> tour = best_tour(from, scene.positions, 5, options, &cover);
    double way = 0;
    for (std::size_t i = 0; i < tour.size(); ++i) {
      way += (scene.positions[tour[i]] - (i == 0 ? from : scene.positions[tour[i - 1]])).norm();
    }
    ASSERT_LE(way, options.most_way_m + 1e-9);
    const double best = best_of_all({}, options.most_way_m, from, scene, 5, options, &cover);
    ASSERT_NEAR(worth(tour, from, scene, 5, options, &cover), best, 1e-4) << "round " << round;
  }
}

INSTANTIATE_TEST_SUITE_P(ViewTour, BestTour, testing::Values(0, 0.7, 2, std::numeric_limits<double>::infinity()));

TEST(ViewTour, OfAFewKeptIsHardlyWorse) {
  std::mt19937 random(5);
  ViewTourOptions few, all;
  few.length = all.length = 4;
  few.kept = 12;
  all.kept = 100000;
  double sum_few = 0, sum_all = 0;
  for (int round = 0; round < 10; ++round) {
    const RandomScene scene(random, 10);
    SetCover cover(scene.views, scene.prior);
    const Eigen::Vector3d from(1, 0, 0);
    const double best = worth(best_tour(from, scene.positions, 5, all, &cover), from, scene, 5, all, &cover);
    const double found = worth(best_tour(from, scene.positions, 5, few, &cover), from, scene, 5, few, &cover);
    EXPECT_LE(found, best + 1e-4);
    sum_few += found;
    sum_all += best;
  }
  EXPECT_GT(sum_few, 0.97 * sum_all);
}

TEST(ViewTour, GoesRoundInThirdsWhereTheOppositeSideIsTheLargestGain) {
  // A ring of twenty-four voxels, seen already from 0 degrees. A view measures what faces it, the middle best; from the
  // opposite side it measures most, but then what is left falls into two narrow parts.
  const auto angle_between = [](int a, int b) { return std::abs((a - b + 36) % 24 - 12) * std::numbers::pi / 12; };
  const auto at = [](int place) {
    const double angle = place * std::numbers::pi / 12;
    return Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
  };
  const auto seen = [&](int voxel, int view) {
    const double angle = angle_between(voxel, view);
    return angle < 1.05 ? 1.0F : angle < 1.4 ? 0.3F : 0.0F;
  };
  std::vector<float> prior;
  for (int voxel = 0; voxel < 24; ++voxel) prior.push_back(1 - seen(voxel, 0));
  std::vector<Eigen::Vector3d> positions;
  Views views;
  for (int view = 1; view < 24; ++view) {
    positions.push_back(at(view));
    std::vector<ExpectedVoxel>& expected = views.emplace_back();
    for (int voxel = 0; voxel < 24; ++voxel) {
      if (seen(voxel, view) > 0) {
        expected.push_back({static_cast<std::uint32_t>(voxel), seen(voxel, view), Eigen::Vector3f::Zero()});
      }
    }
  }
  SetCover cover(views, prior);
  const std::vector<std::size_t> tour = best_tour(at(0), positions, 9, {}, &cover);
  cover.take(tour[0]);
  cover.take(tour[1]);
  double left = 0;
  for (std::size_t view = 0; view < views.size(); ++view) left = std::max(left, cover.gain(view));
  EXPECT_LT(left, 0.5) << "views " << tour[0] + 1 << " and " << tour[1] + 1 << " of 24";
}

TEST(ViewTour, EndsWithTheViews) {
  const std::vector<float> prior{1};
  const Views views{{{0, 0.5F, Eigen::Vector3f::Zero()}}, {}};
  SetCover cover(views, prior);
  const std::vector<Eigen::Vector3d> positions{{1, 0, 0}, {0, 1, 0}};
  const std::vector<std::size_t> expected{0, 1};
  EXPECT_EQ(best_tour({0, 0, 0}, positions, 1, {}, &cover), expected);
}

}  // namespace
}  // namespace vantage
