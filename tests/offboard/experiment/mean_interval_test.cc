#include "offboard/experiment/mean_interval.h"

#include <array>

#include <gtest/gtest.h>

namespace vantage {
namespace {

TEST(StudentT, IsThatOfThePrintedTables) {
  // Two-sided 95 %, as in any book of tables.
  EXPECT_NEAR(student_t_95(1), 12.706, 5e-4);
  EXPECT_NEAR(student_t_95(2), 4.303, 5e-4);
  EXPECT_NEAR(student_t_95(3), 3.182, 5e-4);
  EXPECT_NEAR(student_t_95(4), 2.776, 5e-4);
  EXPECT_NEAR(student_t_95(9), 2.262, 5e-4);
  EXPECT_NEAR(student_t_95(30), 2.042, 5e-4);
  EXPECT_NEAR(student_t_95(1000), 1.962, 5e-4);
}

TEST(MeanInterval, IsTheHandCalculation) {
  // Mean 3, standard deviation sqrt(5/2), t of 4 degrees 2.776: 2.776 * 1.5811 / sqrt(5) = 1.963.
  const MeanInterval interval = mean_interval(std::array{1.0, 2.0, 3.0, 4.0, 5.0});
  EXPECT_DOUBLE_EQ(interval.mean, 3);
  EXPECT_EQ(interval.least, 1);
  EXPECT_EQ(interval.largest, 5);
  ASSERT_TRUE(interval.half_width.has_value());
  EXPECT_NEAR(*interval.half_width, 1.963, 1e-3);
}

TEST(MeanInterval, OfOneValueHasNoWidth) {
  const MeanInterval interval = mean_interval(std::array{0.7});
  EXPECT_EQ(interval.mean, 0.7);
  EXPECT_FALSE(interval.half_width.has_value());
}

}  // namespace
}  // namespace vantage
