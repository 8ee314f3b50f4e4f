#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// How probable it is that an unknown voxel holds surface of the object that no view has measured yet.
///
/// A table of what was found in 17 simulated runs on 9 procedural objects (docs/experiment.md), by three things that
/// the map knows of a voxel:
///  - its distance to the nearest occupied voxel above the ground: surface goes on near surface;
///  - how many of its 26 neighbours are free: what has been seen through is the limit of where the object can be, and
///    an unknown voxel with some free neighbours lies on that limit; with many, it is a crumb that was overlooked;
///  - what hides it (its occlusion mark, Eq. 9): a surface about as near as the nearest occupied voxel, so that it lies
///    directly behind what was seen, most probably inside; another one farther before it; or none, at a picture's
///    edge or beside a depth edge.
/// What faces up is more probable than the table says, what lies outside every picture and does not, less: views look
/// down. The ground (voxels with their centre less than `ground_m` + one voxel above z = 0) holds none.
class SurfacePrior {
 public:
  enum Kind : std::uint8_t { kFree, kUnknown, kSolid };  ///< solid: occupied, or ground

  static constexpr double kGround_m = 0.0;          ///< height of what the object stands on, world
  static constexpr double kFarthest_m = 0.20;       ///< from an occupied voxel; nothing is expected beyond
  static constexpr double kHiddenFarther_m = 0.04;  ///< a mark that exceeds the distance by more is another surface's

  static constexpr int kFacingUnit = 100;
  static constexpr int kDistances = 9, kNeighbourhoods = 4, kHidings = 3;
  static constexpr std::size_t kClasses = kDistances * kNeighbourhoods * kHidings;

  explicit SurfacePrior(const OccupancyMap& map);

  /// All by voxel x + size_x (y + size_y z).
  const std::vector<std::uint8_t>& kind() const { return kind_; }
  const std::vector<float>& probability() const { return probability_; }
  /// Where the surface in an unknown voxel probably faces: to the free voxels within two of it. Parts of kFacingUnit;
  /// all 0 where there are too few.
  const std::vector<std::array<std::int8_t, 3>>& facing() const { return facing_; }

  /// The table's element for an unknown voxel. `mark_m`: negative for none.
  static std::size_t class_of(double distance_m, int free_neighbours, double mark_m);
  /// Of the voxels: kClasses where nothing is expected.
  const std::vector<std::uint8_t>& classes() const { return class_; }

 private:
  void read(const OccupancyMap& map);
  void spread(const Region& region);
  void face(const Region& region);

  std::vector<std::uint8_t> kind_, class_;
  std::vector<float> mark_m_, probability_;
  std::vector<std::array<std::int8_t, 3>> facing_;
};

}  // namespace vantage
