#include "onboard/executive/free_flight.h"

#include <random>

#include <gtest/gtest.h>

#include "lcmtypes/link/depth_map.h"

namespace vantage {
namespace {

Eigen::Isometry3d random_pose(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Eigen::Quaterniond q(normal(random), normal(random), normal(random), normal(random));
  return Eigen::Translation3d(normal(random), normal(random), normal(random)) * q.normalized();
}

TEST(FreeFlight, StartsEndsAndKeepsBothSpeedLimits) {
  const unsigned seed = 2;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  const FlightLimits limits{0.7, 1.1};
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Isometry3d from = random_pose(random), to = random_pose(random);
    const FreeFlight flight(from, to, limits);
    EXPECT_TRUE(flight.pose_at(0).isApprox(from, 1e-9));
    EXPECT_TRUE(flight.pose_at(flight.duration_s()).isApprox(to, 0));
    constexpr int kSteps = 500;
    const double dt = flight.duration_s() / kSteps;
    double fastest = 0, quickest = 0;
    for (int i = 0; i < kSteps; ++i) {
      const Eigen::Isometry3d a = flight.pose_at(i * dt), b = flight.pose_at((i + 1) * dt);
      EXPECT_TRUE(is_rigid(b));
      fastest = std::max(fastest, (b.translation() - a.translation()).norm() / dt);
      quickest = std::max(quickest, Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle() / dt);
    }
    EXPECT_LE(fastest, limits.linear_speed_m_s * 1.001);
    EXPECT_LE(quickest, limits.angular_speed_rad_s * 1.001);
    // One of the two limits is used up: it is not slower than it must be.
    EXPECT_GT(std::max(fastest / limits.linear_speed_m_s, quickest / limits.angular_speed_rad_s), 0.99);
  }
}

TEST(FreeFlight, ToWhereItIsTakesNoTime) {
  const FreeFlight flight(Eigen::Isometry3d::Identity(), Eigen::Isometry3d::Identity(), {1, 1});
  EXPECT_EQ(flight.duration_s(), 0);
  EXPECT_TRUE(flight.pose_at(0).matrix().isIdentity());
}

}  // namespace
}  // namespace vantage
