#pragma once

#include <cmath>
#include <random>

#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// A depth map as sensors give them: a slanted plane with a step, holes, edges, and noise. Deterministic per seed.
inline DepthMap sample_depth_map(int width = 160, int height = 120, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 0.002);
  std::uniform_real_distribution<double> chance;
  DepthMap map;
  map.utime = 1'700'000'000'000'000 + seed;
  map.session = 42;
  map.map_id = seed;
  map.goal_id = 7;
  map.view_id = 3;
  map.camera = {width, height, 0.6 * width, 0.6 * width, width / 2.0, height / 2.0, Distortion::kNone, {}};
  map.T_world_camera =
      Eigen::Translation3d(0.1, -0.2, 0.3) * Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized());
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const double depth = (u < width / 2 ? 0.6 : 1.5) + 0.3 * v / height + noise(random);
      const bool hole = chance(random) < 0.1;
      map.depth_m.push_back(hole ? 0.0F : static_cast<float>(depth));
      map.sigma_m.push_back(hole ? 0.0F : static_cast<float>(0.001 * depth * depth));
      map.state.push_back(hole                          ? DepthState::kInvalid
                          : std::abs(u - width / 2) < 2 ? DepthState::kEdge
                                                        : DepthState::kConverged);
    }
  }
  return map;
}

}  // namespace vantage
