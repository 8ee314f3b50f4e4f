#pragma once

#include <array>
#include <string_view>

#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// What a map tells of an object's shape after one view, in numbers that two objects can be compared by.
///
/// All are taken from voxels more than `kGround_m` above the ground (z = 0), do not change with the object's place, its
/// turn about the vertical, or (but for the voxel's size) its scale, and use counts and spreads, not extremes, so that
/// single wrong voxels move them little. An object of which nothing is seen has all at 0.
struct ShapeDescriptor {
  static constexpr int kSize = 5;
  static constexpr double kGround_m = 0.02;

  std::array<double, kSize> value{};

  /// height: ln of vertical over largest horizontal spread; aspect: ln of smaller over larger horizontal spread; fill:
  /// ln of the seen surface over the square of the largest spread (thin or pierced shapes are low); roughness: mean
  /// share of the smallest principal axis in the spread of occupied voxels around each, of 1/3 at most (flat ones are
  /// 0); hidden: ln of unknown voxels behind a seen surface, within d_max / 2, over the seen surface's voxels.
  static constexpr std::array<std::string_view, kSize> kNames = {"height", "aspect", "fill", "roughness", "hidden"};
};

ShapeDescriptor describe_shape(const OccupancyMap& map);

}  // namespace vantage
