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

  /// What hides it (its occlusion mark, Eq. 9): a surface about as near as the nearest occupied voxel above the ground,
  /// so that it lies directly behind what was seen; another one farther before it; or none, at a picture's edge or
  /// beside a depth edge. kFar: known, ground, or too far from any occupied voxel.
  enum Hiding : std::uint8_t { kBehindNearest, kBehindOther, kInTheOpen, kFar };
  static constexpr int kHidings = kFar;

  static constexpr double kGround_m = 0.0;          ///< height of what the object stands on, world; half a voxel of
                                                    ///< rounding above it is ground, too
  static constexpr double kFarthest_m = 0.20;       ///< from an occupied voxel
  static constexpr double kHiddenFarther_m = 0.04;  ///< a mark that exceeds the distance by more is another surface's
  static constexpr int kFacingUnit = 100;

  /// `surface`: by voxel, how much is expected there; which way it faces is found where that is not negligible.
  VoxelSurroundings(const OccupancyMap& map, std::span<const float> surface);

  const std::vector<std::uint8_t>& kind() const { return kind_; }
  const std::vector<std::uint8_t>& hiding() const { return hiding_; }
  /// Where the surface in a voxel probably faces: to the free voxels within two of it. Parts of kFacingUnit; all 0
  /// where there are too few.
  const std::vector<std::array<std::int8_t, 3>>& facing() const { return facing_; }

  /// Of an unknown voxel. `mark_m`: negative for none.
  static Hiding hiding_of(double distance_m, double mark_m);

 private:
  void read(const OccupancyMap& map);
  void spread(const Region& region);
  void face(const Region& region, std::span<const float> surface);

  std::vector<std::uint8_t> kind_, hiding_;
  std::vector<float> mark_m_;
  std::vector<std::array<std::int8_t, 3>> facing_;
};

}  // namespace vantage
