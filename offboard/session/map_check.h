#pragma once

#include <cstdint>

#include "lcmtypes/link/depth_map.h"
#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// How well a map agrees with depth maps that it was not made from.
struct MapCheck {
  std::int64_t points = 0;               ///< measured pixels
  std::int64_t near_occupied = 0;        ///< of those, within `radius_voxels` of an occupied voxel
  std::int64_t cameras = 0;              ///< depth maps looked at
  std::int64_t cameras_in_occupied = 0;  ///< of those, taken from inside an occupied voxel

  double share() const { return points == 0 ? 0 : static_cast<double>(near_occupied) / static_cast<double>(points); }
};

/// Adds one depth map to the check. A point is near when the centre-to-centre distance between its voxel and an
/// occupied one is at most `radius_voxels`. Points outside the map's region count as not near. \pre depth_map.valid()
void check_depth_map(const OccupancyMap& map, const DepthMap& depth_map, int radius_voxels, MapCheck* check);

}  // namespace vantage
