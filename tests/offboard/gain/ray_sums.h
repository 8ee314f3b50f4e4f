#pragma once

#include <gtest/gtest.h>

#include "offboard/gain/ray_sums.h"

namespace vantage {

/// What every kernel owes the scalar one: counts to the bit, entropies to 1e-5.
inline void expect_equal_counts_and_near_sums(const RaySums& sums, const RaySums& expected) {
  EXPECT_EQ(sums.rays, expected.rays);
  EXPECT_EQ(sums.visits, expected.visits);
  EXPECT_EQ(sums.ends_occupied, expected.ends_occupied);
  EXPECT_EQ(sums.ends_occplane, expected.ends_occplane);
  EXPECT_EQ(sums.rear_side_voxels, expected.rear_side_voxels);
  EXPECT_EQ(sums.proximity_steps, expected.proximity_steps);
  EXPECT_NEAR(sums.entropy, expected.entropy, 1e-5 * expected.entropy);
  EXPECT_NEAR(sums.occlusion_aware, expected.occlusion_aware, 1e-5 * expected.occlusion_aware);
  EXPECT_NEAR(sums.unobserved_voxel, expected.unobserved_voxel, 1e-5 * expected.unobserved_voxel);
  EXPECT_NEAR(sums.rear_side_entropy, expected.rear_side_entropy, 1e-5 * expected.rear_side_entropy + 1e-30);
}

}  // namespace vantage
