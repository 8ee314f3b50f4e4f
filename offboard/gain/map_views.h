#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "offboard/mapping/occupancy_map.h"

namespace vantage {

struct MapViewOptions {
  int max_views = 48;
  double standoff_m = 0.5;         ///< from the camera to what it looks at
  double cluster_m = 0.08;         ///< edge of the cells in which unknown surface voxels are gathered
  int min_cluster_voxels = 8;      ///< smaller gatherings are noise
  double min_camera_z_m = -1e9;    ///< no camera below this height (world)
  double min_separation_m = 0.08;  ///< between cameras that look the same way (to 20 degrees)
  double rear_side_weight = 3;     ///< of a voxel behind a seen surface, against one at a frontier

  /// False, with the reason in `why`.
  bool valid(std::string* why = nullptr) const;
};

/// A view that the map itself offers.
struct MapView {
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  Eigen::Vector3d target = Eigen::Vector3d::Zero();  ///< what it looks at, world, m
  double score = 0;                                  ///< weighted voxels of the region it looks at
  bool rear_side = false;                            ///< more of them lie behind a surface than at a frontier
};

/// "Views from map": sensor poses aimed at frontier regions (unknown voxels beside free ones) and rear-side regions
/// (unknown voxels beside occupied ones), best first.
///
/// Such voxels are gathered in cells; each cell is looked at from where it is open: along the mean direction from its
/// voxels to their free neighbours, or away from their occupied ones, tilted upward if need be until the camera stands
/// in free space or outside the region and no occupied voxel blocks its sight. Deterministic: ties go to the lower
/// cell. \throws std::invalid_argument when the options are not valid.
std::vector<MapView> views_from_map(const OccupancyMap& map, const MapViewOptions& options = {});

}  // namespace vantage
