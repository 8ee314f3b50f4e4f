// The brick layout's short cuts against the voxels they stand for.

#include <algorithm>
#include <array>
#include <bit>
#include <random>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "offboard/gain/cast_kernel.h"
#include "offboard/gain/gain_evaluator.h"
#include "tests/offboard/gain/random_maps.h"
#include "tests/offboard/gain/ray_sums.h"
#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

const Eigen::Vector3i kSize(150, 72, 137);  // holds whole cubes of the largest edge, and ends within bricks

Region region() { return Region{{-0.3, 0.1, -0.2}, kSize, 0.01}; }

template <typename Visit>
void for_each_voxel(const Eigen::Vector3i& first, const Eigen::Vector3i& size, Visit&& visit) {
  Eigen::Vector3i v;
  for (v.z() = first.z(); v.z() < first.z() + size.z(); ++v.z()) {
    for (v.y() = first.y(); v.y() < first.y() + size.y(); ++v.y()) {
      for (v.x() = first.x(); v.x() < first.x() + size.x(); ++v.x()) visit(v);
    }
  }
}

/// A random map, with boxes whose voxels are all marked with one distance.
OccupancyMap boxes_map(std::mt19937* random, int values = 12) {
  OccupancyMap map = random_map(region(), random, values);
  for (int i = 0; i < 12; ++i) {
    Eigen::Vector3i first;
    for (int a = 0; a < 3; ++a) first[a] = static_cast<int>((*random)() % static_cast<unsigned>(kSize[a] - 16));
    for_each_voxel(first, Eigen::Vector3i::Constant(16), [&](const Eigen::Vector3i& v) {
      map.set_unobserved(v);
      map.set_occlusion_distance(v, 0.02 * i);
    });
  }
  return map;
}

/// What the brick layout says of the voxel: the edge of the cube that a ray crosses in one step.
int cube_at(const FieldView& view, const Eigen::Vector3i& v) {
  const auto x = static_cast<unsigned>(v.x()), y = static_cast<unsigned>(v.y()), z = static_cast<unsigned>(v.z());
  const std::int32_t brick =
      view.first_brick + (v.x() >> 3) + (v.y() >> 3) * view.brick_strides[0] + (v.z() >> 3) * view.brick_strides[1];
  const std::uint32_t word = view.cell_words[8 * brick + static_cast<std::int32_t>(cell_in_brick(x, y, z))];
  if ((word & FieldView::kUniformCell) != 0) {
    return static_cast<int>((word & FieldView::kSpanMask) >> FieldView::kSpanShift) + 1;
  }
  const std::uint8_t code = view.cell_codes[64 * (word & FieldView::kCellNumber) + offset_in_cell(x, y, z)];
  return (code & view.table->octet_bit()) != 0 ? 2 : 1;
}

/// Every kernel in bricks against the scalar one, voxel by voxel in the flat layout.
void expect_bricks_equal_voxels(const OccupancyMap& map, const RayBundle& rays,
                                const std::vector<Eigen::Isometry3d>& poses) {
  const GainField flat(map, GainField::Layout::kFlat), bricks(map, GainField::Layout::kBricks);
  ASSERT_TRUE(flat.fits() && bricks.fits());
  GainOptions options;
  options.kernel = name_of(CastKernel::kScalar);
  const auto expected = GainEvaluator(rays, options).evaluate(map, flat, poses);
  for (const CastKernel kernel : available_kernels()) {
    SCOPED_TRACE(name_of(kernel));
    options.kernel = name_of(kernel);
    const auto gains = GainEvaluator(rays, options).evaluate(map, bricks, poses);
    for (std::size_t view = 0; view < poses.size(); ++view) {
      SCOPED_TRACE("view " + std::to_string(view));
      expect_equal_counts_and_near_sums(gains[view].sums, expected[view].sums);
    }
  }
}

std::vector<Eigen::Isometry3d> views_of(const Region& region, std::mt19937* random) {
  std::uniform_real_distribution<double> unit(-0.5, 0.5);
  const Eigen::Vector3d size = region.max_corner() - region.min_corner, middle = region.min_corner + 0.5 * size;
  std::vector<Eigen::Isometry3d> poses;
  for (const double reach : {0.9, 0.9, 3.0, 3.0}) {
    const Eigen::Vector3d offset(unit(*random), unit(*random), unit(*random));
    poses.push_back(look_at(middle + reach * size.cwiseProduct(offset), middle + 0.1 * offset));
  }
  return poses;
}

TEST(BrickLayout, ACubeCrossedInOneStepIsAlignedAlikeAndWithoutProximity) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    std::mt19937 random(seed);
    for (const int values : {12, 90}) {  // with room for octets, and without
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", " << values << " values");
      const OccupancyMap map = boxes_map(&random, values);
      const GainField field(map, GainField::Layout::kBricks);
      const FieldView view = field.view();
      std::array<int, 7> met{};  // by log2 of the edge
      for_each_voxel(Eigen::Vector3i::Zero(), kSize, [&](const Eigen::Vector3i& v) {
        const int edge = cube_at(view, v);
        ++met[static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(edge)))];
        const Eigen::Vector3i first = v / edge * edge;
        if (edge == 1 || first != v) return;
        ASSERT_TRUE(((first.array() + edge) <= kSize.array()).all());
        const VisitCode code = field.code(v);
        ASSERT_EQ(code >> kProximityShift, 0);
        ASSERT_LT(code & kEntryMask, field.table().stop_begin);
        for_each_voxel(first, Eigen::Vector3i::Constant(edge), [&](const Eigen::Vector3i& other) {
          ASSERT_EQ(field.code(other), code) << v.transpose() << " and " << other.transpose();
          ASSERT_EQ(cube_at(view, other), edge);
        });
      });
      EXPECT_EQ(met[1] > 0, values == 12);
      for (const std::size_t log2 : {0U, 2U, 3U, 4U}) EXPECT_GT(met[log2], 0) << "edge " << (1 << log2);
    }
  }
}

TEST(BrickLayout, AUniformMapIsCrossedInTheLargestCubes) {
  const OccupancyMap map(Region{{0, 0, 0}, {128, 64, 64}, 0.01});
  const GainField field(map, GainField::Layout::kBricks);
  for_each_voxel(Eigen::Vector3i::Zero(), {128, 64, 64},
                 [&](const Eigen::Vector3i& v) { ASSERT_EQ(cube_at(field.view(), v), FieldView::kMaxEdge); });
}

TEST(BrickLayout, EveryKernelMeetsTheVoxelsThatAWalkVoxelByVoxelMeets) {
  for (const unsigned seed : {11U, 12U, 13U}) {
    std::mt19937 random(seed);
    for (const int values : {8, 40, 100}) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", " << values << " values");
      const OccupancyMap map = boxes_map(&random, values);
      expect_bricks_equal_voxels(map, RayBundle(vga_camera(), 31, 23), views_of(map.region(), &random));
    }
  }
}

/// Rays so nearly along an axis that they cross one voxel's width, or none, on their way: sums of their times are
/// large.
TEST(BrickLayout, RaysAlmostAlongAnAxisMeetTheSameVoxels) {
  const unsigned seed = 21;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3i size(24, 24, 24);
    size[axis] = 500;
    OccupancyMap map(Region{{0, 0, 0}, size, 0.0025});
    for (int i = 0; i < 3; ++i) {  // few, so that most rays go through to the end
      Eigen::Vector3i v;
      for (int a = 0; a < 3; ++a) v[a] = static_cast<int>(unit(random) * size[a]);
      ASSERT_TRUE(map.set_log_odds(v, i == 0 ? 2.0F : -1.0F));
    }
    std::vector<Eigen::Vector3d> directions;
    for (int i = 0; i < 4000; ++i) {
      Eigen::Vector3d direction;
      for (int a = 0; a < 3; ++a) direction[a] = (i % 2 == 0 ? 1 : -1) / (200 + 1800 * unit(random));
      if (i % 3 == 0) direction = -direction;
      direction[axis] = i % 5 == 0 ? -1 : 1;
      directions.push_back(direction);
    }
    std::vector<Eigen::Isometry3d> poses(6, Eigen::Isometry3d::Identity());
    for (Eigen::Isometry3d& pose : poses) {
      for (int a = 0; a < 3; ++a) pose.translation()[a] = 0.0025 * (0.2 + 0.6 * unit(random)) * size[a];
      pose.translation()[axis] = 0.0025 * (unit(random) < 0.5 ? 2.5 : size[axis] - 2.5);
    }
    expect_bricks_equal_voxels(map, RayBundle(directions), poses);
  }
}

TEST(BrickLayout, VoxelsThatLetAllOrNothingThroughKeepTheirSums) {
  std::mt19937 random(31);
  OccupancyMap map = random_map(region(), &random, 10);
  // Log-odds at which 1 - P is 1 in single precision, almost 1, almost 0, and 0: 1 + q + ... + q^(k-1) still counts.
  const std::array<float, 5> extremes = {-40, -17, -9, 30, 120};
  for (int i = 0; i < 40; ++i) {
    Eigen::Vector3i first;
    for (int a = 0; a < 3; ++a) first[a] = static_cast<int>(random() % static_cast<unsigned>(kSize[a] - 24)) / 4 * 4;
    const float value = extremes[static_cast<std::size_t>(i) % extremes.size()];
    const int edge = value > 0 ? 2 : 24;
    for_each_voxel(first, Eigen::Vector3i::Constant(edge),
                   [&](const Eigen::Vector3i& v) { ASSERT_TRUE(map.set_log_odds(v, value)); });
  }
  expect_bricks_equal_voxels(map, RayBundle(vga_camera(), 31, 23), views_of(map.region(), &random));
  // Nothing else to drown them.
  for (const float value : {-40.0F, -17.0F, -9.0F}) {
    OccupancyMap alone(Region{{0, 0, 0}, {80, 80, 80}, 0.01});
    for_each_voxel(Eigen::Vector3i::Zero(), {80, 80, 80},
                   [&](const Eigen::Vector3i& v) { ASSERT_TRUE(alone.set_log_odds(v, value)); });
    expect_bricks_equal_voxels(alone, RayBundle(vga_camera(), 31, 23), views_of(alone.region(), &random));
  }
}

TEST(BrickLayout, ABlocksSumsDoNotDependOnWhatIsCastWithIt) {
  std::mt19937 random(41);
  const OccupancyMap map = boxes_map(&random);
  const GainEvaluator evaluator(RayBundle(vga_camera(), 61, 43), {});
  for (const GainField::Layout layout : {GainField::Layout::kFlat, GainField::Layout::kBricks}) {
    const GainField field(map, layout);
    for (const CastKernel kernel : available_kernels()) {
      SCOPED_TRACE(name_of(kernel));
      const CastBlocks cast = cast_function(kernel, layout);
      const GridWalk walk = GainEvaluator::walk_of(map, views_of(map.region(), &random)[2]);
      std::vector<std::size_t> blocks(evaluator.block_count());
      for (std::size_t i = 0; i < blocks.size(); ++i) blocks[i] = i;
      std::vector<RaySums> alone(blocks.size()), together(blocks.size());
      for (const std::size_t block : blocks) cast(field.view(), walk, evaluator.columns(), &block, 1, &alone[block]);
      for (int i = 0; i < 5; ++i) {
        if (i > 0) {  // some of them, in disorder
          std::shuffle(blocks.begin(), blocks.end(), random);
          blocks.resize(blocks.size() * 2 / 3);
        }
        cast(field.view(), walk, evaluator.columns(), blocks.data(), blocks.size(), together.data());
        for (std::size_t k = 0; k < blocks.size(); ++k)
          ASSERT_EQ(together[k], alone[blocks[k]]) << "block " << blocks[k];
      }
    }
  }
}

}  // namespace
}  // namespace vantage
