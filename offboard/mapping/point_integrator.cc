// OccupancyMap::integrate_points: the exact ray walk.

#include <cmath>
#include <unordered_map>
#include <utility>

#include "offboard/mapping/occupancy_map.h"
#include "offboard/mapping/ray_walk.h"

namespace vantage {
namespace {

/// What a cloud says of a brick's voxels.
struct Evidence {
  std::array<std::uint8_t, OccupancyMap::kBrickVoxels> hit{}, missed{}, mark{};  // mark as in OccupancyMap
};

class PointIntegration {
 public:
  PointIntegration(const Eigen::Vector3d& origin, OccupancyMap* map)
      : map_(*map), start_(map->region().to_voxels(origin)), slots_(map->brick_count(), 0) {}

  void add(const Eigen::Vector3d& point);
  IntegrationResult apply();

 private:
  Evidence& evidence(const Eigen::Vector3i& voxel) {
    const std::size_t brick = map_.brick_index(voxel / OccupancyMap::kBrickEdge);
    if (slots_[brick] == 0) {
      evidence_.emplace_back(brick, Evidence{});
      slots_[brick] = static_cast<std::uint32_t>(evidence_.size());
    }
    return evidence_[slots_[brick] - 1].second;
  }

  OccupancyMap& map_;
  Eigen::Vector3d start_;             // the sensor, voxels from the region's corner
  std::vector<std::uint32_t> slots_;  // by brick: 1 + element of evidence_
  std::vector<std::pair<std::size_t, Evidence>> evidence_;
};

void PointIntegration::add(const Eigen::Vector3d& point) {
  const Region& region = map_.region();
  const double max_range = map_.sensor_model().max_range_m / region.resolution_m;
  const double occlusion_range = map_.sensor_model().occlusion_range_m / region.resolution_m;
  const Eigen::Vector3d offset = region.to_voxels(point) - start_;
  const double range = offset.norm();
  if (range == 0) return;
  const Eigen::Vector3d direction = offset / range;
  const bool hit = range <= max_range;
  const Eigen::Vector3d end = start_ + std::min(range, max_range) * direction;
  const Eigen::Vector3i end_voxel = end.array().floor().max(-1).min(Region::kMaxSizeVoxels + 1).cast<int>();
  if (hit && region.contains(end_voxel)) evidence(end_voxel).hit[OccupancyMap::index_in_brick(end_voxel)] = 1;
  const double last = hit ? range + occlusion_range : max_range;
  bool behind = false;
  walk_ray(start_, direction, region.size_voxels, [&](const Eigen::Vector3i& voxel, double enter, double leave) {
    if (voxel == end_voxel) {
      behind = true;
      return hit;
    }
    if (enter >= last) return false;
    const std::size_t i = OccupancyMap::index_in_brick(voxel);
    // An end point on a voxel's face may lie, by rounding, in the neighbour of the voxel that the walk ends in.
    if (!behind && 0.5 * (enter + leave) < std::min(range, max_range)) {
      evidence(voxel).missed[i] = 1;
      return true;
    }
    if (!hit) return false;
    behind = true;
    const double distance = (voxel.cast<double>().array() + 0.5 - end.array()).matrix().norm() * region.resolution_m;
    if (distance <= map_.sensor_model().occlusion_range_m) {
      const std::uint8_t mark = map_.mark_of_distance(distance);
      std::uint8_t& smallest = evidence(voxel).mark[i];
      if (smallest == 0 || mark < smallest) smallest = mark;
    }
    return true;
  });
}

IntegrationResult PointIntegration::apply() {
  map_.next_revision();
  IntegrationResult result;
  LogOddsLevels& levels = map_.levels();
  for (const auto& [brick, evidence] : evidence_) {
    OccupancyMap::Brick& voxels = map_.open(brick);
    bool changed = false;
    for (std::size_t i = 0; i < OccupancyMap::kBrickVoxels; ++i) {
      if (evidence.hit[i] != 0 || evidence.missed[i] != 0) {
        const bool hit = evidence.hit[i] != 0;
        (hit ? result.voxels_hit : result.voxels_missed) += 1;
        const Level after = levels.after(hit ? VoxelUpdate::kHit : VoxelUpdate::kMiss, voxels.level[i]);
        changed |= after != voxels.level[i];
        voxels.level[i] = after;
      } else if (evidence.mark[i] != 0 && (voxels.mark[i] == 0 || evidence.mark[i] < voxels.mark[i])) {
        voxels.mark[i] = evidence.mark[i];
        changed = true;
        ++result.voxels_marked;
      }
    }
    map_.close(brick, changed);
    result.bricks_changed += changed;
  }
  if (result.voxels_marked != 0) map_.set_has_marks(true);
  result.ok = true;
  return result;
}

}  // namespace

IntegrationResult OccupancyMap::integrate_points(const Eigen::Vector3d& origin,
                                                 const std::vector<Eigen::Vector3d>& points) {
  IntegrationResult result;
  if (!origin.allFinite()) {
    result.error = "the sensor's origin is not finite";
    return result;
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) {
      result.error = "point " + std::to_string(i) + " is not finite";
      return result;
    }
  }
  PointIntegration integration(origin, this);
  for (const Eigen::Vector3d& point : points) integration.add(point);
  return integration.apply();
}

}  // namespace vantage
