#include "drivers/robot/motion_limits.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace vantage {
namespace {

constexpr double kPeriod = 0.01;
const MotionLimits kLimits{-1.0, 2.0, 1.5, 5.0};

/// Checks the laws after every step, against the step before.
class Watched {
 public:
  explicit Watched(double start) : limiter_(kLimits, kPeriod) { limiter_.reset(start); }

  void towards(double wanted) {
    check([&] { limiter_.towards(wanted); });
  }
  void at_speed(double wanted) {
    check([&] { limiter_.at_speed(wanted); });
  }
  const MotionLimiter& limiter() const { return limiter_; }

 private:
  template <typename Step>
  void check(Step&& step) {
    const double position = limiter_.position(), speed = limiter_.speed();
    step();
    constexpr double kRounding = 1e-9;
    EXPECT_LE(std::abs(limiter_.speed()), kLimits.speed + kRounding);
    EXPECT_LE(std::abs(limiter_.speed() - speed), kLimits.acceleration * kPeriod + kRounding);
    EXPECT_NEAR(limiter_.position(), position + limiter_.speed() * kPeriod, kRounding);
    const double room =
        limiter_.speed() > 0 ? kLimits.upper - limiter_.position() : limiter_.position() - kLimits.lower;
    EXPECT_GE(room, -kRounding);
    // speed <= sqrt(2 a room), squared: the root is ill-conditioned at the end itself.
    EXPECT_LE(limiter_.speed() * limiter_.speed() / (2 * kLimits.acceleration), room + kRounding);
  }

  MotionLimiter limiter_;
};

TEST(MotionLimiter, KeepsEveryLawUnderAnyWishes) {
  const unsigned seed = 3;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> wild(-4, 4);
  std::uniform_int_distribution<int> some(1, 150);
  Watched watched(0.3);
  for (int wish = 0; wish < 3000; ++wish) {
    const double wanted = wish % 50 == 0 ? std::nan("") : wild(random);
    const int cycles = some(random);
    for (int i = 0; i < cycles; ++i) wish % 2 == 0 ? watched.towards(wanted) : watched.at_speed(wanted);
    ASSERT_FALSE(testing::Test::HasFailure()) << "wish " << wish << " seed " << seed;
  }
}

TEST(MotionLimiter, ArrivesExactlyAndAsFastAsATrapezoidAllows) {
  for (const double goal : {1e-6, 0.003, 0.2, 1.9}) {
    Watched watched(0);
    int cycles = 0;
    while ((watched.limiter().position() != goal || watched.limiter().speed() != 0) && cycles < 2000) {
      watched.towards(goal);
      ++cycles;
    }
    EXPECT_NEAR(watched.limiter().position(), goal, 1e-12);
    // Time of the trapezoid (or triangle) of these limits.
    const double ramp = kLimits.speed * kLimits.speed / kLimits.acceleration;
    const double ideal = goal > ramp ? goal / kLimits.speed + kLimits.speed / kLimits.acceleration
                                     : 2 * std::sqrt(goal / kLimits.acceleration);
    // In steps of a period, whose last ones creep up on the braking curve.
    EXPECT_LE(cycles * kPeriod, ideal * 1.05 + 12 * kPeriod) << goal;
    EXPECT_GE((cycles + 2) * kPeriod, ideal) << goal;
  }
}

TEST(MotionLimiter, SaysWhenAWishIsCut) {
  MotionLimiter limiter(kLimits, kPeriod);
  limiter.reset(0);
  limiter.towards(1.9);
  EXPECT_FALSE(limiter.limited());
  limiter.towards(2.1);
  EXPECT_TRUE(limiter.limited());
  limiter.towards(std::nan(""));
  EXPECT_TRUE(limiter.limited());
}

TEST(MotionLimiter, OutsideItsRangeAJointMayOnlyComeBack) {
  for (const double start : {2.05, -1.05}) {
    MotionLimiter limiter(kLimits, kPeriod);
    limiter.reset(start);
    for (int i = 0; i < 100; ++i) limiter.at_speed(start > 0 ? 1.0 : -1.0);
    EXPECT_EQ(limiter.position(), start);
    for (int i = 0; i < 200; ++i) limiter.towards(0.5);
    EXPECT_NEAR(limiter.position(), 0.5, 1e-9);
  }
}

}  // namespace
}  // namespace vantage
