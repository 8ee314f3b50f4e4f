#pragma once

#include <Eigen/Geometry>

#include "offboard/gain/ray_bundle.h"
#include "offboard/gain/view_gain.h"
#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// Casts the rays one by one, voxel by voxel, in double precision, straight from the map: the formulas as they stand in
/// the paper. What the fast kernels are held against, and what serves maps whose values do not fit their tables.
/// `T_world_camera` must be rigid.
RaySums cast_rays_reference(const OccupancyMap& map, const RayBundle& rays, const Eigen::Isometry3d& T_world_camera);

/// True for an unknown voxel with an occlusion mark of which a face neighbour is free (an occplane voxel, Eq. 18).
bool is_occplane(const OccupancyMap& map, const Eigen::Vector3i& voxel);

}  // namespace vantage
