#include "offboard/session/map_check.h"

#include <vector>

namespace vantage {
namespace {

std::vector<Eigen::Vector3i> ball(int radius_voxels) {
  std::vector<Eigen::Vector3i> offsets;
  for (int z = -radius_voxels; z <= radius_voxels; ++z) {
    for (int y = -radius_voxels; y <= radius_voxels; ++y) {
      for (int x = -radius_voxels; x <= radius_voxels; ++x) {
        const Eigen::Vector3i offset(x, y, z);
        if (offset.squaredNorm() <= radius_voxels * radius_voxels) offsets.push_back(offset);
      }
    }
  }
  return offsets;
}

bool near_occupied(const OccupancyMap& map, const Eigen::Vector3d& point, const std::vector<Eigen::Vector3i>& offsets) {
  Eigen::Vector3i centre;
  if (!map.region().voxel_at(point, &centre)) return false;
  for (const Eigen::Vector3i& offset : offsets) {
    const Eigen::Vector3i voxel = centre + offset;
    if (map.region().contains(voxel) && map.state(voxel) == VoxelState::kOccupied) return true;
  }
  return false;
}

}  // namespace

void check_depth_map(const OccupancyMap& map, const DepthMap& depth_map, int radius_voxels, MapCheck* check) {
  const std::vector<Eigen::Vector3i> offsets = ball(radius_voxels);
  ++check->cameras;
  const Eigen::Vector3d position = depth_map.T_world_camera.translation();
  if (map.state_at(position) == VoxelState::kOccupied) ++check->cameras_in_occupied;
  const CameraModel& camera = depth_map.camera;
  std::size_t i = 0;
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u, ++i) {
      if (depth_map.state[i] != DepthState::kConverged && depth_map.state[i] != DepthState::kEdge) continue;
      const double z = static_cast<double>(depth_map.depth_m[i]);
      const Eigen::Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
      ++check->points;
      if (near_occupied(map, depth_map.T_world_camera * (z * ray), offsets)) ++check->near_occupied;
    }
  }
}

}  // namespace vantage
