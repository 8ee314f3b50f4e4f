#pragma once

#include <octomap/OcTree.h>

#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// OctoMap with a map's resolution and sensor model.
inline octomap::OcTree make_octree(const Region& region, const SensorModel& model) {
  octomap::OcTree tree(region.resolution_m);
  tree.setProbHit(model.hit_probability);
  tree.setProbMiss(model.miss_probability);
  tree.setClampingThresMin(model.clamp_min);
  tree.setClampingThresMax(model.clamp_max);
  return tree;
}

inline octomap::point3d to_point3d(const Eigen::Vector3d& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

/// OctoMap's node at a voxel of the region, null where there is none. The region must lie on OctoMap's grid.
inline const octomap::OcTreeNode* node_at(const octomap::OcTree& tree, const Region& region,
                                          const Eigen::Vector3i& voxel) {
  const Eigen::Vector3i key = (region.min_corner / region.resolution_m).array().round().cast<int>().matrix() + voxel +
                              Eigen::Vector3i::Constant(32768);
  return tree.search(octomap::OcTreeKey(static_cast<octomap::key_type>(key.x()),
                                        static_cast<octomap::key_type>(key.y()),
                                        static_cast<octomap::key_type>(key.z())));
}

}  // namespace vantage
