#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// What an unknown voxel's surroundings tell of the surface that it may hold. All by voxel x + size_x (y + size_y z).
class VoxelSurroundings {
 public:
  enum Kind : std::uint8_t { kFree, kUnknown, kSolid };  ///< solid: occupied, or ground

  static constexpr double kFarthest_m = 0.20;  ///< from an occupied voxel above the ground: farther off is not near
  static constexpr int kFacingUnit = 100;

  /// `surface`: by voxel, how much is expected there; which way it faces is found where that is not negligible.
  /// `ground_m`: height of what the object stands on, world; half a voxel of rounding above it is ground, too.
  VoxelSurroundings(const OccupancyMap& map, std::span<const float> surface, double ground_m);

  const std::vector<std::uint8_t>& kind() const { return kind_; }
  /// 1: unknown, and near something occupied.
  const std::vector<std::uint8_t>& near() const { return near_; }
  /// Where the surface in a voxel probably faces: to the free voxels within two of it. Parts of kFacingUnit; all 0
  /// where there are too few.
  const std::vector<std::array<std::int8_t, 3>>& facing() const { return facing_; }

 private:
  void read(const OccupancyMap& map);
  void spread(const Region& region, double ground_m);
  void face(const Region& region, std::span<const float> surface);

  std::vector<std::uint8_t> kind_, near_;
  std::vector<std::array<std::int8_t, 3>> facing_;
};

}  // namespace vantage
