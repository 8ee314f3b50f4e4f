#include "offboard/gain/reference_gain.h"

#include "offboard/mapping/ray_walk.h"

namespace vantage {
namespace {

bool is_unknown(VoxelState state) { return state == VoxelState::kUnobserved || state == VoxelState::kUncertain; }

RaySums cast_ray(const OccupancyMap& map, const Eigen::Vector3d& start, const Eigen::Vector3d& direction) {
  RaySums sums{.rays = 1};
  double visibility = 1;   // P_v of the voxel being visited (Eq. 4)
  double run_entropy = 0;  // sum of I_v over the unknown voxels directly before it
  bool before_unknown = false, met_occplane = false;
  walk_ray(start, direction, map.region().size_voxels, [&](const Eigen::Vector3i& voxel, double, double) {
    const Level level = map.level(voxel);
    const VoxelState state = map.levels().state(level);
    const double entropy = map.levels().entropy(level);
    const double visible_entropy = visibility * entropy;
    ++sums.visits;
    sums.entropy += entropy;
    sums.occlusion_aware += visible_entropy;
    visibility *= 1 - map.levels().probability(level);
    if (state == VoxelState::kOccupied) {
      sums.rear_side_voxels += before_unknown;
      sums.rear_side_entropy += run_entropy;
      sums.ends_occupied += !met_occplane;
      return false;
    }
    before_unknown = is_unknown(state);
    if (before_unknown) {
      sums.unobserved_voxel += visible_entropy;
      run_entropy += visible_entropy;
      const int mark = map.mark(voxel);
      if (mark != 0) sums.proximity_steps += OccupancyMap::kMarkSteps + 1 - mark;
      met_occplane = met_occplane || is_occplane(map, voxel);
    } else {
      run_entropy = 0;
    }
    return true;
  });
  sums.ends_occplane = met_occplane;
  return sums;
}

}  // namespace

bool is_occplane(const OccupancyMap& map, const Eigen::Vector3i& voxel) {
  if (!map.has_mark(voxel) || !is_unknown(map.state(voxel))) return false;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      const Eigen::Vector3i neighbour = voxel + side * Eigen::Vector3i::Unit(axis);
      if (map.region().contains(neighbour) && map.state(neighbour) == VoxelState::kFree) return true;
    }
  }
  return false;
}

RaySums cast_rays_reference(const OccupancyMap& map, const RayBundle& rays, const Eigen::Isometry3d& T_world_camera) {
  const Eigen::Vector3d start = map.region().to_voxels(T_world_camera.translation());
  RaySums sums;
  for (const Eigen::Vector3d& direction : rays.directions()) {
    sums += cast_ray(map, start, T_world_camera.linear() * direction);
  }
  return sums;
}

}  // namespace vantage
