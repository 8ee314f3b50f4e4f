#include "offboard/mapping/depth_history.h"

#include <gtest/gtest.h>

#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

DepthMap image(std::size_t view) {
  CameraModel camera = vga_camera();
  camera = {160, 120, 112, 112, 79.5, 59.5, Distortion::kNone, {}};
  return AnalyticScene{}.depth_map(camera, ring_views()[view], 0.002, static_cast<unsigned>(view));
}

Region region() { return Region::cube({0, 0, 0.3}, 0.64, 0.02); }

TEST(DepthHistory, AnyAdditionsRemovalsAndCorrectionsEqualOneFreshIntegration) {
  const unsigned seed = 31;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  DepthHistory history(region(), SensorModel{}, TsdfOptions{});
  std::vector<std::pair<std::int64_t, DepthMap>> expected;
  for (int step = 0; step < 24; ++step) {
    const unsigned what = random() % 4;
    if (what < 2 || expected.size() < 3) {
      const std::size_t view = random() % 48;
      const auto id = static_cast<std::int64_t>(100 + step);
      expected.emplace_back(id, image(view));
      ASSERT_TRUE(history.add(id, image(view)).ok);
    } else if (what == 2) {
      const std::size_t i = random() % expected.size();
      ASSERT_TRUE(history.remove(expected[i].first).ok);
      expected.erase(expected.begin() + static_cast<std::ptrdiff_t>(i));
    } else {
      const std::size_t i = random() % expected.size();
      Eigen::Isometry3d& pose = expected[i].second.T_world_camera;
      pose.translation() += Eigen::Vector3d(0.02, -0.01, 0.015);
      pose.linear() = Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitX()) * pose.linear();
      ASSERT_TRUE(history.correct(expected[i].first, pose).ok);
    }
    OccupancyMap map(region());
    Tsdf tsdf(region());
    for (const auto& [id, depth_map] : expected) ASSERT_TRUE(map.integrate(depth_map, &tsdf).ok);
    ASSERT_TRUE(history.map() == map) << "step " << step;
    ASSERT_TRUE(*history.tsdf() == tsdf) << "step " << step;
    ASSERT_EQ(history.map().entropy_nats(), map.entropy_nats());
    ASSERT_EQ(history.map().has_marks(), map.has_marks());
  }
  history.rebuild();
  OccupancyMap map(region());
  for (const auto& [id, depth_map] : expected) ASSERT_TRUE(map.integrate(depth_map).ok);
  EXPECT_TRUE(history.map() == map);
}

TEST(DepthHistory, RefusesWhatItCannotDoAndChangesNothing) {
  DepthHistory history(region(), SensorModel{});
  ASSERT_TRUE(history.add(1, image(0)).ok);
  const OccupancyMap before = history.map();
  EXPECT_FALSE(history.add(1, image(3)).ok);
  EXPECT_FALSE(history.remove(2).ok);
  EXPECT_FALSE(history.correct(2, Eigen::Isometry3d::Identity()).ok);
  Eigen::Isometry3d bad = Eigen::Isometry3d::Identity();
  bad.translation().x() = NAN;
  EXPECT_FALSE(history.correct(1, bad).ok);
  DepthMap broken = image(3);
  broken.sigma_m[100] = 0;
  broken.state[100] = DepthState::kConverged;
  EXPECT_FALSE(history.add(3, broken).ok);
  EXPECT_TRUE(history.map() == before);
  EXPECT_EQ(history.size(), 1U);
  ASSERT_TRUE(history.remove(1).ok);
  EXPECT_TRUE(history.map() == OccupancyMap(region()));
}

}  // namespace
}  // namespace vantage
