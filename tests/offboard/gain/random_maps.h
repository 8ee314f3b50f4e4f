#pragma once

#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "offboard/gain/ray_bundle.h"
#include "offboard/mapping/occupancy_map.h"
#include "offboard/mapping/ray_walk.h"

namespace vantage {

/// A map of blobs: boxes of free, occupied, uncertain and marked voxels over an unobserved region, and single voxels
/// strewn in between. `values` distinct log-odds.
inline OccupancyMap random_map(const Region& region, std::mt19937* random, int values = 12) {
  OccupancyMap map(region);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<float> log_odds = {1.3862944F, -1.3862944F, 3.4760987F, -3.4760987F, 0.0F, 0.5F};
  while (static_cast<int>(log_odds.size()) < values) log_odds.push_back(static_cast<float>(7 * unit(*random) - 3.5));
  const auto paint = [&](const Eigen::Vector3i& low, const Eigen::Vector3i& high) {
    // Free more often than not, so that rays get somewhere.
    const double what = unit(*random);
    const float value = what < 0.45 ? log_odds[1 + 2 * (*random)() % 2] : log_odds[(*random)() % log_odds.size()];
    Eigen::Vector3i v;
    for (v.z() = low.z(); v.z() < high.z(); ++v.z()) {
      for (v.y() = low.y(); v.y() < high.y(); ++v.y()) {
        for (v.x() = low.x(); v.x() < high.x(); ++v.x()) {
          if (what < 0.75) {
            map.set_log_odds(v, value);
          } else {
            map.set_occlusion_distance(v, 0.31 * unit(*random));
          }
        }
      }
    }
  };
  for (int i = 0; i < 60; ++i) {
    Eigen::Vector3i low, high;
    for (int a = 0; a < 3; ++a) {
      const int size = region.size_voxels[a],
                edge = 1 + static_cast<int>((*random)() % static_cast<unsigned>(i < 30 ? std::max(1, size / 2) : 2));
      low[a] = static_cast<int>((*random)() % static_cast<unsigned>(size));
      high[a] = std::min(size, low[a] + edge);
    }
    paint(low, high);
  }
  for (int i = 0; i < values; ++i) {  // every value occurs
    const Eigen::Vector3i v(static_cast<int>((*random)() % static_cast<unsigned>(region.size_voxels.x())),
                            static_cast<int>((*random)() % static_cast<unsigned>(region.size_voxels.y())),
                            static_cast<int>((*random)() % static_cast<unsigned>(region.size_voxels.z())));
    map.set_log_odds(v, log_odds[static_cast<std::size_t>(i) % log_odds.size()]);
  }
  return map;
}

/// Random unit vectors from `origin` (m) that meet no edge of a voxel nearer than `margin` voxels, measured along the
/// ray: which of two voxels comes first is then beyond the doubt of rounding.
inline std::vector<Eigen::Vector3d> clear_directions(const Region& region, const Eigen::Vector3d& origin, int count,
                                                     double margin, std::mt19937* random) {
  std::normal_distribution<double> normal(0, 1);
  const Eigen::Vector3d start = region.to_voxels(origin);
  std::vector<Eigen::Vector3d> directions;
  for (int tried = 0; tried < 100 * count && static_cast<int>(directions.size()) < count; ++tried) {
    const Eigen::Vector3d inside = region.min_corner + (region.max_corner() - region.min_corner)
                                                           .cwiseProduct(Eigen::Vector3d(0.5 + 0.25 * normal(*random),
                                                                                         0.5 + 0.25 * normal(*random),
                                                                                         0.5 + 0.25 * normal(*random)));
    if ((inside - origin).norm() < 1e-3) continue;
    const Eigen::Vector3d direction = (inside - origin).normalized();
    bool clear = true;
    walk_ray(start, direction, region.size_voxels, [&](const Eigen::Vector3i&, double enter, double leave) {
      clear = clear && leave - enter > margin;
      return clear;
    });
    if (clear) directions.push_back(direction);
  }
  return directions;
}

}  // namespace vantage
