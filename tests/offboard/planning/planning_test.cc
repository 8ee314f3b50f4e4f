#include <cmath>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "calib/look_at.h"
#include "offboard/planning/planner.h"
#include "offboard/planning/utility.h"
#include "offboard/planning/view_space.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

TEST(Utility, FollowsEquation11ByHand) {
  std::vector<ScoredView> views{{0, 3, 1, 0}, {1, 1, 0, 0}, {2, 0, 3, 0}};
  compute_utilities(&views);
  EXPECT_DOUBLE_EQ(views[0].utility, 3.0 / 4 - 1.0 / 4);
  EXPECT_DOUBLE_EQ(views[1].utility, 1.0 / 4);
  EXPECT_DOUBLE_EQ(views[2].utility, -3.0 / 4);
  EXPECT_EQ(next_best_view(views), 0u);
}

TEST(Utility, AZeroSumMakesItsTermZero) {
  std::vector<ScoredView> views{{0, 0, 1, 0}, {1, 0, 3, 0}};
  compute_utilities(&views);
  EXPECT_DOUBLE_EQ(views[0].utility, -0.25);
  views = {{0, 1, 0, 0}, {1, 3, 0, 0}};
  compute_utilities(&views);
  EXPECT_DOUBLE_EQ(views[1].utility, 0.75);
}

TEST(Utility, TiesGoToTheLowerCostThenToTheLowerId) {
  EXPECT_EQ(next_best_view({{5, 0, 2, 0.5}, {4, 0, 1, 0.5}, {3, 0, 1, 0.4}}), 1u);
  EXPECT_EQ(next_best_view({{5, 0, 1, 0.5}, {4, 0, 1, 0.5}}), 1u);
  EXPECT_EQ(next_best_view({}), std::nullopt);
}

TEST(GainStop, IsReachedWhenAllGainLess) {  // Eq. 13
  const std::vector<ScoredView> views{{0, 3, 1, 0}, {1, 1, 0, 0}};
  EXPECT_FALSE(GainStop({.gain = 3}).reached(views));
  EXPECT_EQ(GainStop({.gain = 3.01}).reached(views), "no view gains 3.01 any more");
  EXPECT_FALSE(GainStop({.gain = 3}).reached({})) << "of no views nothing is said";
}

TEST(GainStop, AShareIsOfTheLargestGainOfTheFirstCall) {
  const std::vector<ScoredView> first{{0, 3, 1, 0}, {1, 8, 0, 0}}, more{{0, 20, 0, 0}}, two{{0, 2, 0, 0}},
      less{{0, 1.99, 0, 0}};
  GainStop stop({.share = 0.25});
  EXPECT_FALSE(stop.reached({}));
  EXPECT_FALSE(stop.reached(first));
  EXPECT_FALSE(stop.reached(more)) << "not the reference";
  EXPECT_FALSE(stop.reached(two));
  EXPECT_EQ(stop.reached(less), "no view gains 2 any more, 0.25 of what the best did at first");
  GainStop both({.gain = 2.5, .share = 0.25});
  EXPECT_FALSE(both.reached(first));
  EXPECT_EQ(both.reached(two), "no view gains 2.5 any more") << "whichever ends first";
  GainStop none({});
  EXPECT_FALSE(none.reached(first));
  EXPECT_FALSE(none.reached(std::vector<ScoredView>{{0, 0, 0, 0}})) << "no limit, no end";
}

TEST(ViewSpace, ThePapers48ViewsFaceTheObjectAndStandUpright) {
  const std::vector<CandidateView> views = cylinder_views();
  ASSERT_EQ(views.size(), 48u);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Eigen::Isometry3d& pose = views[i].T_world_camera;
    EXPECT_EQ(views[i].id, static_cast<std::int64_t>(i));
    EXPECT_TRUE(is_rigid(pose));
    const Eigen::Vector3d target_in_camera = pose.inverse() * Eigen::Vector3d(0, 0, 0.15);
    EXPECT_LT(target_in_camera.head<2>().norm(), 1e-9);
    EXPECT_GT(target_in_camera.z(), 0.5);
    EXPECT_NEAR(pose.linear().col(0).z(), 0, 1e-9);  // x level
    EXPECT_LT(pose.linear().col(1).z(), 0);          // y down
    const Eigen::Vector3d p = pose.translation();
    const double radius = p.head<2>().norm();
    if (i < 32) {
      EXPECT_NEAR(radius, 0.6, 1e-9);
      EXPECT_NEAR(p.z(), i < 16 ? 0.15 : 0.35, 1e-9);
    } else {  // on the half-sphere around (0, 0, 0.35), 45 degrees up
      EXPECT_NEAR((p - Eigen::Vector3d(0, 0, 0.35)).norm(), 0.6, 1e-9);
      EXPECT_NEAR(p.z() - 0.35, radius, 1e-9);
    }
  }
}

TEST(ViewSpace, StraightDownIsUprightToo) {
  const Eigen::Isometry3d pose = look_at({0, 0, 1}, {0, 0, 0});
  EXPECT_TRUE(is_rigid(pose));
  EXPECT_TRUE(pose.linear().col(2).isApprox(-Eigen::Vector3d::UnitZ()));
}

TEST(ViewSpace, AFileWithoutViewsIsRefused) {
  const auto path = std::filesystem::path(testing::TempDir()) / "no_views.txt";
  std::ofstream(path) << "# nothing\n\n";
  EXPECT_THROW(read_views(path), InputError);
}

/// A planner with gains that the test decides.
class PlannerTest : public testing::Test {
 protected:
  std::vector<CandidateView> views_on_a_line(int count) {
    std::vector<CandidateView> views;
    for (int i = 0; i < count; ++i) {
      views.push_back({i, Eigen::Isometry3d::Identity()});
      views.back().T_world_camera.translation().x() = i;
    }
    return views;
  }
  DepthMap map_of(const CandidateView& view, std::int64_t utime = 0) {
    DepthMap map = sample_depth_map(32, 24);
    map.view_id = view.id;
    map.T_world_camera = view.T_world_camera;
    map.utime = utime;
    return map;
  }
  static std::unique_ptr<ViewChooser> by_x() {
    return std::make_unique<UtilityChooser>(
        [](const OccupancyMap&, const CameraModel&, const std::vector<Eigen::Isometry3d>& poses) {
          std::vector<double> gains;
          for (const auto& pose : poses) gains.push_back(pose.translation().x());
          return gains;
        });
  }
  Volume volume_{Region{}, SensorModel{}};
  std::string why_;
};

TEST_F(PlannerTest, GoesToTheLargestUtilityAndNeverTwice) {
  Planner planner(volume_, views_on_a_line(4), by_x(), {.first_view = 1, .most_views = 10});
  ASSERT_EQ(planner.goal()->id, 1);
  // From x = 1: gains 0, 2, 3; costs 1, 1, 2: utilities -1/4, 2/5 - 1/4, 3/5 - 2/4.
  auto step = planner.take(map_of(*planner.goal()), &why_);
  ASSERT_TRUE(step) << why_;
  ASSERT_EQ(step->scores.size(), 3u);
  EXPECT_DOUBLE_EQ(step->scores[1].utility, 2.0 / 5 - 1.0 / 4);
  EXPECT_DOUBLE_EQ(step->scores[2].utility, 3.0 / 5 - 2.0 / 4);
  EXPECT_EQ(planner.goal()->id, 2);
  step = planner.take(map_of(*planner.goal()), &why_);
  EXPECT_EQ(planner.goal()->id, 3);
  EXPECT_DOUBLE_EQ(step->path_m, 1);
  step = planner.take(map_of(*planner.goal()), &why_);
  EXPECT_EQ(planner.goal()->id, 0);
  step = planner.take(map_of(*planner.goal()), &why_);
  EXPECT_DOUBLE_EQ(step->path_m, 1 + 1 + 3);
  EXPECT_EQ(step->reason, "every candidate has been visited");
  EXPECT_EQ(planner.state(), PlannerState::kFinished);
  EXPECT_FALSE(planner.take(map_of(views_on_a_line(1)[0]), &why_));
  EXPECT_EQ(why_, "the run is over");
}

TEST_F(PlannerTest, StopsAtTheLimitOfViews) {
  Planner planner(volume_, views_on_a_line(4), by_x(), {.most_views = 2});
  planner.take(map_of(*planner.goal()), &why_);
  const auto step = planner.take(map_of(*planner.goal()), &why_);
  EXPECT_EQ(step->reason, "the limit of 2 views is reached");
  EXPECT_FALSE(planner.goal());
}

TEST_F(PlannerTest, StopsWhenNoViewGainsEnough) {  // Eq. 13
  Planner planner(volume_, views_on_a_line(4), by_x(), {.most_views = 10, .enough = {.gain = 2.5}});
  auto step = planner.take(map_of(*planner.goal()), &why_);
  EXPECT_TRUE(step->next);  // view 3 gains 3
  step = planner.take(map_of(views_on_a_line(4)[3]), &why_);
  EXPECT_FALSE(step->next);
  EXPECT_EQ(step->reason, "no view gains 2.5 any more");
}

TEST_F(PlannerTest, StopsAtTheLimitOfTimeByTheMapsOwnTimes) {
  Planner planner(volume_, views_on_a_line(4), by_x(), {.most_views = 10, .most_seconds = 5});
  EXPECT_TRUE(planner.take(map_of(*planner.goal(), 1'000'000), &why_)->next);
  EXPECT_TRUE(planner.take(map_of(*planner.goal(), 5'900'000), &why_)->next);
  EXPECT_FALSE(planner.take(map_of(*planner.goal(), 6'000'000), &why_)->next);
}

TEST_F(PlannerTest, GoesNoFartherThanTheLimitOfWay) {
  Planner planner(volume_, views_on_a_line(6), by_x(), {.first_view = 1, .most_views = 10, .most_way_m = 2.5});
  auto step = planner.take(map_of(*planner.goal()), &why_);
  ASSERT_TRUE(step) << why_;
  EXPECT_EQ(step->scores.size(), 3U) << "0, 2 and 3; not 4, which gains more";
  ASSERT_EQ(step->next->id, 2);
  step = planner.take(map_of(*planner.goal()), &why_);
  ASSERT_EQ(step->scores.size(), 1U) << "1.5 m are left";
  ASSERT_EQ(step->next->id, 3);
  step = planner.take(map_of(*planner.goal()), &why_);
  EXPECT_FALSE(step->next);
  EXPECT_NE(step->reason.find("within the limit of 2.5"), std::string::npos) << step->reason;
  EXPECT_EQ(planner.state(), PlannerState::kFinished);
}

TEST_F(PlannerTest, ARefusedMapChangesNothing) {
  Planner planner(volume_, views_on_a_line(4), by_x(), {});
  DepthMap bad = map_of(*planner.goal());
  bad.T_world_camera.translation().x() = std::nan("");
  EXPECT_FALSE(planner.take(bad, &why_));
  EXPECT_FALSE(why_.empty());
  EXPECT_EQ(planner.goal()->id, 0);
  EXPECT_EQ(volume_.map().counts().unobserved, volume_.map().region().voxel_count());
  EXPECT_EQ(planner.take(map_of(*planner.goal()), &why_)->step, 1);
}

TEST_F(PlannerTest, AFirstViewThatIsNotThereIsNamed) {
  EXPECT_THROW(Planner(volume_, views_on_a_line(4), by_x(), {.first_view = 4}), InputError);
}

}  // namespace
}  // namespace vantage
