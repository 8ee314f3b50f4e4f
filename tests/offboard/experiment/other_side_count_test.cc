#include "offboard/experiment/other_side_count.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vantage {
namespace {

TEST(OtherSideCount, FitFindsTheFactorsThatMadeTheCounts) {
  const OtherSide made{-0.2, 0.9, 0.4};
  OtherSideCount count;
  for (int i = -10; i <= 10; ++i) {
    for (int j = -2; j <= 10; ++j) {
      const Bearing bearing{1, 2, 0.1 * i, 0.1 * j};
      count.add(bearing, 3, 3 * std::exp(made.constant + made.away * bearing.away + made.above * bearing.above));
    }
  }
  const OtherSides sides = count.fit();
  EXPECT_NEAR(sides[1][2].constant, made.constant, 1e-3);
  EXPECT_NEAR(sides[1][2].away, made.away, 1e-3);
  EXPECT_NEAR(sides[1][2].above, made.above, 1e-3);
  EXPECT_EQ(sides[0][0].away, 0) << "of which nothing was counted";
}

TEST(OtherSideCount, OneVoxelsLuckMakesNoFactor) {
  OtherSideCount count;
  count.add({0, 0, 1, 0}, 0.3, 1);
  EXPECT_EQ(count.fit()[0][0].constant, 0);
}

TEST(OtherSideCount, WhatIsNeverFoundLosesItsPromise) {
  OtherSideCount count;
  for (int i = 0; i < 100; ++i) count.add({0, 1, -0.5, 0.1}, 1, 0);
  const OtherSide side = count.fit()[0][1];
  EXPECT_LT(std::exp(side.constant - 0.5 * side.away + 0.1 * side.above), 0.01);
}

TEST(OtherSideCount, CountsOfScenesAddUp) {
  OtherSideCount whole, part, other;
  for (int i = 0; i < 40; ++i) {
    const Bearing bearing{0, 0, i % 2 == 0 ? 0.5 : -0.5, 0.1 * (i % 3)};
    const double found = i % 2 == 0 ? 2 : 0.5;
    whole.add(bearing, 1, found);
    (i < 20 ? part : other).add(bearing, 1, found);
  }
  part.add(other);
  EXPECT_NEAR(part.fit()[0][0].away, whole.fit()[0][0].away, 1e-12);
  EXPECT_NEAR(whole.fit()[0][0].away, std::log(4.0), 0.02);
}

}  // namespace
}  // namespace vantage
