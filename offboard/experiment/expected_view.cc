#include "offboard/experiment/expected_view.h"

#include <algorithm>
#include <utility>

#include "offboard/mapping/ray_walk.h"

namespace vantage {
namespace {

std::size_t index_of(const Region& region, const Eigen::Vector3i& voxel) {
  const Eigen::Matrix<std::size_t, 3, 1> v = voxel.cast<std::size_t>(), size = region.size_voxels.cast<std::size_t>();
  return v.x() + size.x() * (v.y() + size.y() * v.z());
}

}  // namespace

ExpectedViews::ExpectedViews(const OccupancyMap& map, const ExpectedViewOptions& options)
    : region_(map.region()), options_(options) {
  const auto voxels = static_cast<std::size_t>(region_.voxel_count());
  kind_.assign(voxels, kUnknown);
  prior_.assign(voxels, 0);
  sight_.assign(voxels, 0);
  const double d_max = map.sensor_model().occlusion_range_m;
  for (std::size_t b = 0; b < map.brick_count(); ++b) {
    const Eigen::Vector3i position = map.brick_position(b), extent = map.brick_extent(position);
    const OccupancyMap::Brick* dense = map.dense(b);
    for (int z = 0; z < extent.z(); ++z) {
      for (int y = 0; y < extent.y(); ++y) {
        for (int x = 0; x < extent.x(); ++x) {
          const std::size_t in_brick = OccupancyMap::index_in_brick({x, y, z});
          const Eigen::Vector3i voxel = OccupancyMap::kBrickEdge * position + Eigen::Vector3i(x, y, z);
          const std::size_t i = index_of(region_, voxel);
          const VoxelState state = map.levels().state(dense == nullptr ? map.uniform_level(b) : dense->level[in_brick]);
          kind_[i] = state == VoxelState::kFree ? kFree : state == VoxelState::kOccupied ? kOccupied : kUnknown;
          if (kind_[i] != kUnknown || dense == nullptr || dense->mark[in_brick] == 0) continue;
          const double distance_m = (dense->mark[in_brick] - 1) * map.mark_step_m();
          prior_[i] = static_cast<float>(1 - distance_m / d_max);
        }
      }
    }
  }
}

std::vector<ExpectedVoxel> ExpectedViews::see(const RayBundle& rays, const Eigen::Isometry3d& T_world_camera) {
  const Eigen::Vector3d start = region_.to_voxels(T_world_camera.translation());
  const auto transparency = static_cast<float>(options_.transparency);
  const auto least = static_cast<float>(options_.least_sight);
  std::vector<ExpectedVoxel> seen;
  for (const Eigen::Vector3d& ray : rays.directions()) {
    float sight = 1;
    walk_ray(start, T_world_camera.linear() * ray, region_.size_voxels,
             [&](const Eigen::Vector3i& voxel, double, double) {
               const std::size_t i = index_of(region_, voxel);
               if (kind_[i] == kFree) return true;
               if (kind_[i] == kOccupied) return false;
               if (prior_[i] > 0) {
                 if (sight_[i] == 0) seen.push_back({static_cast<std::uint32_t>(i), 0});
                 sight_[i] = std::max(sight_[i], sight);
               }
               sight *= transparency;
               return sight >= least;
             });
  }
  for (ExpectedVoxel& voxel : seen) voxel.probability = std::exchange(sight_[voxel.voxel], 0.0F);
  return seen;
}

}  // namespace vantage
