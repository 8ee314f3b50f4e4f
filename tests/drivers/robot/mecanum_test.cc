#include "drivers/robot/mecanum.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "drivers/robot/twist_limiter.h"

namespace vantage {
namespace {

constexpr double kRadius = 0.0475, kLength = 0.47, kWidth = 0.30;
const MecanumKinematics kBase(kRadius, kLength, kWidth);

TEST(Mecanum, AgreesWithTheYoubotsDriverButForItsSigns) {
  // hardware-facts: FL, FR, BL, BR = (-x+y+k turn, x+y+k turn, -x-y+k turn, x-y+k turn)/r; left motors are mirrored.
  const double x = 0.3, y = -0.2, turn = 0.7, k = (kLength + kWidth) / 2;
  const WheelValues wheels = kBase.wheels_of({x, y, turn});
  EXPECT_NEAR(-wheels[0], (-x + y + k * turn) / kRadius, 1e-12);
  EXPECT_NEAR(wheels[1], (x + y + k * turn) / kRadius, 1e-12);
  EXPECT_NEAR(-wheels[2], (-x - y + k * turn) / kRadius, 1e-12);
  EXPECT_NEAR(wheels[3], (x - y + k * turn) / kRadius, 1e-12);
}

TEST(Mecanum, WheelsAndTwistAreInverse) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> some(-2, 2);
  for (int i = 0; i < 100; ++i) {
    const BaseTwist twist{some(random), some(random), some(random)};
    const BaseTwist back = kBase.twist_of(kBase.wheels_of(twist));
    EXPECT_NEAR(back.x_m_s, twist.x_m_s, 1e-12);
    EXPECT_NEAR(back.y_m_s, twist.y_m_s, 1e-12);
    EXPECT_NEAR(back.turn_rad_s, twist.turn_rad_s, 1e-12);
  }
}

TEST(Odometry, AFullCircleEndsWhereItBeganInAnyNumberOfSteps) {
  // At 0.5 m/s and 1 rad/s the base goes round a circle of 0.5 m.
  for (const int steps : {3, 7, 100, 100'000}) {
    const double t = 2 * M_PI / steps;
    BasePose pose{1, 2, 0.3};
    BasePose half;
    for (int i = 0; i < steps; ++i) {
      pose = advance(pose, {0.5 * t, 0.2 * t, t});
      if (steps == 100 && i == 49) half = pose;
    }
    EXPECT_NEAR(pose.x_m, 1, 1e-9) << steps;
    EXPECT_NEAR(pose.y_m, 2, 1e-9) << steps;
    EXPECT_NEAR(pose.heading_rad, 0.3 + 2 * M_PI, 1e-9);
    if (steps == 100) {
      EXPECT_NEAR(std::hypot(half.x_m - 1, half.y_m - 2), 2 * std::hypot(0.5, 0.2), 1e-9);
    }
  }
}

TEST(Odometry, TheExactArcEqualsFineSteps) {
  // A thousand steps of a thousandth, each by the midpoint, come to the arc within their second-order error.
  const BaseTwist way{0.4, -0.1, 0.9};
  const BasePose arc = advance({0, 0, 0.5}, way);
  BasePose fine{0, 0, 0.5};
  constexpr int kSteps = 1000;
  for (int i = 0; i < kSteps; ++i) {
    const double heading = fine.heading_rad + 0.5 * way.turn_rad_s / kSteps;
    fine.x_m += (std::cos(heading) * way.x_m_s - std::sin(heading) * way.y_m_s) / kSteps;
    fine.y_m += (std::sin(heading) * way.x_m_s + std::cos(heading) * way.y_m_s) / kSteps;
    fine.heading_rad += way.turn_rad_s / kSteps;
  }
  EXPECT_NEAR(arc.x_m, fine.x_m, 1e-7);
  EXPECT_NEAR(arc.y_m, fine.y_m, 1e-7);
}

TEST(Odometry, IsSmoothWhereTheSeriesTakesOver) {
  for (const double a : {0.99e-4, 1.01e-4, -0.99e-4, -1.01e-4}) {
    const BasePose pose = advance({}, {1, 0.5, a});
    EXPECT_NEAR(pose.x_m, std::sin(a) / a - 0.5 * (1 - std::cos(a)) / a, 1e-12);
  }
}

TEST(TwistLimiter, KeepsSpeedRimAndAccelerationAndTheDirection) {
  const TwistLimits limits{0.8, 1.5, 1.5, 3.0};
  TwistLimiter limiter(limits, kBase, kRadius, 0.01);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> wild(-3, 3);
  BaseTwist before;
  for (int i = 0; i < 5000; ++i) {
    static BaseTwist wanted;
    if (i % 100 == 0) wanted = {wild(random), wild(random), i % 300 == 0 ? std::nan("") : wild(random)};
    const BaseTwist twist = limiter.towards(wanted);
    EXPECT_LE(std::hypot(twist.x_m_s, twist.y_m_s), limits.speed_m_s + 1e-9);
    EXPECT_LE(std::abs(twist.turn_rad_s), limits.turn_speed_rad_s + 1e-9);
    for (const double wheel : kBase.wheels_of(twist)) EXPECT_LE(std::abs(wheel) * kRadius, limits.speed_m_s + 1e-9);
    EXPECT_LE(std::hypot(twist.x_m_s - before.x_m_s, twist.y_m_s - before.y_m_s),
              limits.acceleration_m_s2 * 0.01 + 1e-9);
    EXPECT_LE(std::abs(twist.turn_rad_s - before.turn_rad_s), limits.turn_acceleration_rad_s2 * 0.01 + 1e-9);
    before = twist;
  }
  limiter.reset();
  BaseTwist last;
  for (int i = 0; i < 500; ++i) last = limiter.towards({3, 1.5, 0.6});
  EXPECT_NEAR(last.y_m_s / last.x_m_s, 0.5, 1e-9);
  EXPECT_NEAR(last.turn_rad_s / last.x_m_s, 0.2, 1e-9);
  EXPECT_TRUE(limiter.limited());
}

}  // namespace
}  // namespace vantage
