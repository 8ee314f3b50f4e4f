// Each formula on rows and planes of voxels small enough for a hand calculation.

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "offboard/gain/cast_kernel.h"
#include "offboard/gain/view_gain.h"

namespace vantage {
namespace {

const double kLn2 = std::log(2.0);
const double kH = 0.8 * std::log(1.25) + 0.2 * std::log(5.0);  // entropy of P = 0.2 and of P = 0.8
const auto kLogOdds4 = static_cast<float>(std::log(4.0));

/// A row along x: 'f' free (0.2), 'o' occupied (0.8), '.' unobserved, 'u' observed at 0.5, 'm' unobserved with d = 0.1
/// m (d_max is 0.3 m).
OccupancyMap row_map(const std::string& row, int y = 0, OccupancyMap* into = nullptr) {
  OccupancyMap fresh(Region{{0, 0, 0}, {static_cast<int>(row.size()), 1, 1}, 1.0});
  OccupancyMap& map = into != nullptr ? *into : fresh;
  for (int x = 0; x < static_cast<int>(row.size()); ++x) {
    const char c = row[static_cast<std::size_t>(x)];
    const Eigen::Vector3i voxel(x, y, 0);
    if (c == 'f') map.set_log_odds(voxel, -kLogOdds4);
    if (c == 'o') map.set_log_odds(voxel, kLogOdds4);
    if (c == 'u') map.set_log_odds(voxel, 0);
    if (c == 'm') map.set_occlusion_distance(voxel, 0.1);
  }
  return fresh;
}

/// From before the row's first voxel along +x; or, `backwards`, from behind its last along -x.
ViewGain look(const OccupancyMap& map, const std::string& kernel, bool backwards = false, int y = 0) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(backwards ? map.region().size_voxels.x() + 1 : -1, y + 0.5, 0.5);
  GainOptions options;
  options.kernel = kernel;
  return evaluate_view(map, RayBundle({Eigen::Vector3d(backwards ? -1 : 1, 0, 0)}), pose, options);
}

class HandCases : public testing::TestWithParam<std::string> {
 protected:
  void expect(const ViewGain& gain, Formulation formulation, double value) {
    EXPECT_NEAR(gain[formulation], value, 1e-5 * std::max(1.0, std::abs(value))) << name_of(formulation);
  }
};

TEST_P(HandCases, FreeThenUnknownThenTheBackOfASurface) {
  const ViewGain gain = look(row_map("f..o."), GetParam());
  EXPECT_EQ(gain.sums.visits, 4);  // the occupied voxel ends the ray and counts
  expect(gain, Formulation::kEntropy, 2 * kH + 2 * kLn2);
  // P_v = 1, 0.8, 0.4, 0.2
  expect(gain, Formulation::kOcclusionAware, kH + 0.8 * kLn2 + 0.4 * kLn2 + 0.2 * kH);
  expect(gain, Formulation::kUnobservedVoxel, 0.8 * kLn2 + 0.4 * kLn2);
  expect(gain, Formulation::kRearSideVoxel, 1);
  expect(gain, Formulation::kRearSideEntropy, 0.8 * kLn2 + 0.4 * kLn2);
  expect(gain, Formulation::kProximityCount, 0);
  expect(gain, Formulation::kAverageEntropy, (2 * kH + 2 * kLn2) / 4);
  expect(gain, Formulation::kCombined, 30 * (2 * kH + 2 * kLn2) / 4 + 1.2 * kLn2);
}

TEST_P(HandCases, TheVisibilityProductWithTheWrongSignIsAnotherNumber) {
  const ViewGain gain = look(row_map("f..o."), GetParam());
  // With P instead of 1 - P: P_v = 1, 0.2, 0.1, 0.05.
  const double wrong = kH + 0.2 * kLn2 + 0.1 * kLn2 + 0.05 * kH;
  EXPECT_GT(gain[Formulation::kOcclusionAware] - wrong, 0.5);
  EXPECT_GT(gain[Formulation::kUnobservedVoxel] - (0.2 * kLn2 + 0.1 * kLn2), 0.5);
  EXPECT_GT(gain[Formulation::kRearSideEntropy] - (0.2 * kLn2 + 0.1 * kLn2), 0.5);
  // It also ranks views the other way round: free space before the unknown must not hide it.
  const ViewGain clear = look(row_map("ffff...."), GetParam()), blocked = look(row_map("uuuu...."), GetParam());
  EXPECT_GT(clear[Formulation::kOcclusionAware], blocked[Formulation::kOcclusionAware]);
}

TEST_P(HandCases, TheFrontOfASurfaceHasNoRearSide) {
  const ViewGain gain = look(row_map("fffo.."), GetParam());
  expect(gain, Formulation::kRearSideVoxel, 0);
  expect(gain, Formulation::kRearSideEntropy, 0);
  expect(gain, Formulation::kUnobservedVoxel, 0);
  expect(gain, Formulation::kOcclusionAware, kH * (1 + 0.8 + 0.64 + 0.512));
}

TEST_P(HandCases, OnlyTheUnbrokenRunBeforeTheSurfaceCounts) {
  const ViewGain gain = look(row_map(".f.uo"), GetParam());
  // P_v = 1, 0.5, 0.4, 0.2, 0.1; the first voxel is cut off by the free one.
  expect(gain, Formulation::kRearSideEntropy, 0.4 * kLn2 + 0.2 * kLn2);
  expect(gain, Formulation::kRearSideVoxel, 1);
  expect(gain, Formulation::kUnobservedVoxel, kLn2 + 0.4 * kLn2 + 0.2 * kLn2);
}

TEST_P(HandCases, ARayThatMeetsNoSurfaceHasNoRearSide) {
  const ViewGain gain = look(row_map("f..f.u"), GetParam());
  EXPECT_EQ(gain.sums.visits, 6);
  expect(gain, Formulation::kRearSideVoxel, 0);
  expect(gain, Formulation::kRearSideEntropy, 0);
  expect(gain, Formulation::kEntropy, 2 * kH + 4 * kLn2);
}

TEST_P(HandCases, AnOccupiedFirstVoxelIsAllThereIs) {
  const ViewGain gain = look(row_map("o...."), GetParam());
  EXPECT_EQ(gain.sums.visits, 1);
  expect(gain, Formulation::kEntropy, kH);
  expect(gain, Formulation::kOcclusionAware, kH);
  expect(gain, Formulation::kRearSideVoxel, 0);
}

TEST_P(HandCases, ProximityCountsMarkedUnknownVoxelsAlone) {
  OccupancyMap map = row_map("fmmf.o");
  map.set_occlusion_distance({3, 0, 0}, 0.05);  // a mark on a free voxel counts for nothing
  const ViewGain gain = look(map, GetParam());
  // d is kept to half a step of d_max / 254.
  EXPECT_NEAR(gain[Formulation::kProximityCount], 2 * (0.3 - 0.1), 2 * 0.3 / 254 / 2 + 1e-9);
  EXPECT_FALSE(gain.marks_missing);
}

TEST_P(HandCases, ARayEndsForTheAreaFactorAtTheFirstOccupiedOrOccplaneVoxel) {
  // From the front: free, then a marked voxel beside free space: occplane. From the back: unmarked, marked but not
  // beside free space, then occplane.
  const ViewGain front = look(row_map("ffmm.o"), GetParam());
  EXPECT_EQ(front.sums.ends_occplane, 1);
  EXPECT_EQ(front.sums.ends_occupied, 0);
  expect(front, Formulation::kAreaFactor, 0);  // f(0, 0.2) + f(1, 0.8)
  const ViewGain back = look(row_map("ffmm.."), GetParam(), true);
  EXPECT_EQ(back.sums.ends_occplane, 1);
  const ViewGain surface = look(row_map("ff.o.."), GetParam());
  EXPECT_EQ(surface.sums.ends_occupied, 1);
  EXPECT_EQ(surface.sums.ends_occplane, 0);
  EXPECT_TRUE(surface.marks_missing);
}

/// Figure 1's situations in one plane: a wall of one voxel (o) seen from the left; behind it unknown space near the
/// wall (m), farther unknown space, and beside it open space.
TEST_P(HandCases, ThePlaneOfFigure1) {
  const std::vector<std::string> rows = {"ffffffff",   // past the wall: free to the end
                                         "fffom...",   // wall, its shadow
                                         "fffom...",   //
                                         "ffffmm.."};  // grazes the wall's edge: occluded space beside free space
  OccupancyMap map(Region{{0, 0, 0}, {8, 4, 1}, 1.0});
  for (int y = 0; y < 4; ++y) row_map(rows[static_cast<std::size_t>(y)], y, &map);

  const ViewGain front = look(map, GetParam(), false, 1), back = look(map, GetParam(), true, 1);
  expect(front, Formulation::kRearSideVoxel, 0);  // what is seen already teaches nothing
  expect(front, Formulation::kUnobservedVoxel, 0);
  expect(back, Formulation::kRearSideVoxel, 1);  // the wall's unseen side
  expect(back, Formulation::kRearSideEntropy, kLn2 * (1 + 0.5 + 0.25 + 0.125));
  EXPECT_NEAR(back[Formulation::kProximityCount], 0.2, 1e-3);
  EXPECT_GT(back[Formulation::kOcclusionAware], 0);

  const ViewGain open = look(map, GetParam(), false, 0);
  expect(open, Formulation::kRearSideVoxel, 0);
  double visible = 0;
  for (int i = 0; i < 8; ++i) visible += kH * std::pow(0.8, i);
  expect(open, Formulation::kOcclusionAware, visible);

  const ViewGain edge = look(map, GetParam(), false, 3);
  EXPECT_EQ(edge.sums.ends_occplane, 1);
  EXPECT_NEAR(edge[Formulation::kProximityCount], 0.4, 2e-3);

  // All four rays from the left as one view: shares of ends 2/4 occupied, 1/4 occplane.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(-1000, 2, 0.5);
  std::vector<Eigen::Vector3d> directions;
  for (int y = 0; y < 4; ++y) directions.emplace_back(1004, y - 1.5, 0);
  GainOptions options;
  options.kernel = GetParam();
  const ViewGain all = evaluate_view(map, RayBundle(directions), pose, options);
  EXPECT_EQ(all.sums.ends_occupied, 2);
  EXPECT_EQ(all.sums.ends_occplane, 1);
  expect(all, Formulation::kAreaFactor, area_factor(0.5, 0.2) + area_factor(0.25, 0.8));
}

TEST_P(HandCases, ADiagonalRayMeetsTheVoxelsOfAmanatidesAndWoo) {
  // From (0.3, -0.2) with slope 1 through 3 x 3 voxels: enters (0,0) at x = 0.5, then (1,0) at x = 1, (1,1), (2,1),
  // (2,2).
  OccupancyMap map(Region{{0, 0, 0}, {3, 3, 1}, 1.0});
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(0.3, -0.2, 0.5);
  GainOptions options;
  options.kernel = GetParam();
  const RayBundle ray({Eigen::Vector3d(1, 1, 0)});
  EXPECT_EQ(evaluate_view(map, ray, pose, options).sums.visits, 5);
  map.set_log_odds({2, 1, 0}, kLogOdds4);
  EXPECT_EQ(evaluate_view(map, ray, pose, options).sums.visits, 4);
  map.set_log_odds({2, 0, 0}, kLogOdds4);  // not on the way
  map.set_log_odds({0, 1, 0}, kLogOdds4);
  EXPECT_EQ(evaluate_view(map, ray, pose, options).sums.visits, 4);
  map.set_log_odds({1, 0, 0}, kLogOdds4);
  EXPECT_EQ(evaluate_view(map, ray, pose, options).sums.visits, 2);
}

std::vector<std::string> kernel_names() {
  std::vector<std::string> names;
  for (const CastKernel kernel : available_kernels()) names.emplace_back(name_of(kernel));
  return names;
}

INSTANTIATE_TEST_SUITE_P(Kernels, HandCases, testing::ValuesIn(kernel_names()),
                         [](const auto& named) { return named.param; });

}  // namespace
}  // namespace vantage
