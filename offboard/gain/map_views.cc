#include "offboard/gain/map_views.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

#include "offboard/mapping/ray_walk.h"

namespace vantage {
namespace {

/// Unknown surface voxels of one cell.
struct Cluster {
  std::size_t cell = 0;
  int frontier = 0, rear_side = 0;
  Eigen::Vector3d position_sum = Eigen::Vector3d::Zero();  // of the voxels' centres, world, m
  Eigen::Vector3d outward_sum = Eigen::Vector3d::Zero();   // from the unknown towards where it can be seen from
};

bool is_unknown(VoxelState state) { return state == VoxelState::kUnobserved || state == VoxelState::kUncertain; }

/// Camera at `eye` that looks at `target`, z up in the image.
Eigen::Isometry3d aim(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  const bool steep = std::abs(forward.z()) > 0.999;
  const Eigen::Vector3d right = forward.cross(steep ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() << right, forward.cross(right), forward;
  pose.translation() = eye;
  return pose;
}

std::vector<Cluster> gather(const OccupancyMap& map, const MapViewOptions& options) {
  const Region& region = map.region();
  const int edge = std::max(1, static_cast<int>(std::lround(options.cluster_m / region.resolution_m)));
  const Eigen::Vector3i cells = (region.size_voxels.array() + (edge - 1)) / edge;
  std::unordered_map<std::size_t, Cluster> clusters;
  for (std::size_t brick = 0; brick < map.brick_count(); ++brick) {
    if (map.dense(brick) == nullptr && !is_unknown(map.levels().state(map.uniform_level(brick)))) continue;
    const Eigen::Vector3i position = map.brick_position(brick), extent = map.brick_extent(position);
    const bool uniform = map.dense(brick) == nullptr;
    Eigen::Vector3i offset;
    for (offset.z() = 0; offset.z() < extent.z(); ++offset.z()) {
      for (offset.y() = 0; offset.y() < extent.y(); ++offset.y()) {
        for (offset.x() = 0; offset.x() < extent.x(); ++offset.x()) {
          // Inside a uniform brick no voxel has a neighbour of another kind.
          if (uniform && (offset.array() > 0).all() && (offset.array() < extent.array() - 1).all()) continue;
          const Eigen::Vector3i voxel = OccupancyMap::kBrickEdge * position + offset;
          if (!is_unknown(map.state(voxel))) continue;
          Eigen::Vector3d outward = Eigen::Vector3d::Zero();
          bool beside_free = false, beside_occupied = false;
          for (int axis = 0; axis < 3; ++axis) {
            for (const int side : {-1, 1}) {
              const Eigen::Vector3i neighbour = voxel + side * Eigen::Vector3i::Unit(axis);
              if (!region.contains(neighbour)) continue;
              const VoxelState state = map.state(neighbour);
              beside_free = beside_free || state == VoxelState::kFree;
              beside_occupied = beside_occupied || state == VoxelState::kOccupied;
              if (state == VoxelState::kFree) outward[axis] += side;
              if (state == VoxelState::kOccupied) outward[axis] -= side;
            }
          }
          if (!beside_free && !beside_occupied) continue;
          const Eigen::Vector3i at = voxel / edge;
          const auto cell = static_cast<std::size_t>(at.x()) +
                            static_cast<std::size_t>(cells.x()) *
                                (static_cast<std::size_t>(at.y()) +
                                 static_cast<std::size_t>(cells.y()) * static_cast<std::size_t>(at.z()));
          Cluster& cluster = clusters[cell];
          cluster.cell = cell;
          (beside_occupied ? cluster.rear_side : cluster.frontier) += 1;
          cluster.position_sum += region.center(voxel);
          cluster.outward_sum += outward;
        }
      }
    }
  }
  std::vector<Cluster> found;
  for (const auto& [cell, cluster] : clusters) {
    if (cluster.frontier + cluster.rear_side >= options.min_cluster_voxels) found.push_back(cluster);
  }
  return found;
}

/// True when a camera can stand at `eye` and see as far as the cell around `target`.
bool can_see(const OccupancyMap& map, const Eigen::Vector3d& eye, const Eigen::Vector3d& target, double cell_m) {
  const Region& region = map.region();
  Eigen::Vector3i voxel;
  if (region.voxel_at(eye, &voxel) && map.state(voxel) != VoxelState::kFree) return false;
  const double reach = ((target - eye).norm() - cell_m) / region.resolution_m;
  bool clear = true;
  walk_ray(region.to_voxels(eye), (target - eye).normalized(), region.size_voxels,
           [&](const Eigen::Vector3i& at, double enter, double) {
             if (enter > reach) return false;
             clear = map.state(at) != VoxelState::kOccupied;
             return clear;
           });
  return clear;
}

}  // namespace

bool MapViewOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (max_views < 1) return fail("max_views must be positive");
  if (!(std::isfinite(standoff_m) && standoff_m > 0)) return fail("standoff_m must be finite and positive");
  if (!(std::isfinite(cluster_m) && cluster_m > 0)) return fail("cluster_m must be finite and positive");
  if (min_cluster_voxels < 1) return fail("min_cluster_voxels must be positive");
  if (!std::isfinite(min_camera_z_m)) return fail("min_camera_z_m must be finite");
  if (!(std::isfinite(min_separation_m) && min_separation_m >= 0)) {
    return fail("min_separation_m must be finite and not negative");
  }
  if (!(std::isfinite(rear_side_weight) && rear_side_weight >= 0)) {
    return fail("rear_side_weight must be finite and not negative");
  }
  return true;
}

std::vector<MapView> views_from_map(const OccupancyMap& map, const MapViewOptions& options) {
  std::string why;
  if (!options.valid(&why)) throw std::invalid_argument(why);
  std::vector<Cluster> clusters = gather(map, options);
  const auto score = [&](const Cluster& c) { return c.frontier + options.rear_side_weight * c.rear_side; };
  std::sort(clusters.begin(), clusters.end(), [&](const Cluster& a, const Cluster& b) {
    return score(a) != score(b) ? score(a) > score(b) : a.cell < b.cell;
  });
  std::vector<MapView> views;
  for (const Cluster& cluster : clusters) {
    if (static_cast<int>(views.size()) >= options.max_views) break;
    const double count = cluster.frontier + cluster.rear_side;
    const Eigen::Vector3d target = cluster.position_sum / count;
    Eigen::Vector3d outward = cluster.outward_sum;
    if (outward.norm() < 0.1 * count) outward = Eigen::Vector3d::UnitZ();  // open on all sides
    outward.normalize();
    for (const double lift : {0.0, 0.4, 0.8, 1.6, 1e3}) {  // more and more from above
      const Eigen::Vector3d direction = (outward + lift * Eigen::Vector3d::UnitZ()).normalized();
      const Eigen::Vector3d eye = target + options.standoff_m * direction;
      if (eye.z() < options.min_camera_z_m || !can_see(map, eye, target, options.cluster_m)) continue;
      const bool crowded = std::any_of(views.begin(), views.end(), [&](const MapView& view) {
        return (view.T_world_camera.translation() - eye).norm() < options.min_separation_m &&
               view.T_world_camera.linear().col(2).dot(-direction) > std::cos(20 * M_PI / 180);
      });
      if (!crowded) {
        views.push_back({aim(eye, target), target, score(cluster), cluster.rear_side > cluster.frontier});
      }
      break;
    }
  }
  return views;
}

}  // namespace vantage
