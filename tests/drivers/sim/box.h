#pragma once

#include <limits>

#include <Eigen/Core>

#include "drivers/sim/mesh.h"

namespace vantage::sim {

/// An axis-aligned box, closed: the object of these tests, for everything about it can be calculated by hand.
struct Box {
  Eigen::Vector3d low, high;

  Mesh mesh() const {
    Mesh mesh;
    for (int i = 0; i < 8; ++i) {
      mesh.points.push_back(
          Eigen::Vector3d((i & 1 ? high : low).x(), (i & 2 ? high : low).y(), (i & 4 ? high : low).z()).cast<float>());
    }
    mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    return mesh;
  }

  /// Where the ray from + t direction, t > 0, enters the box (the slab method); infinity when it misses.
  double hit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    double enter = 0, leave = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
      const double a = (low[k] - from[k]) / direction[k], b = (high[k] - from[k]) / direction[k];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    return enter < leave ? enter : std::numeric_limits<double>::infinity();
  }
};

/// The two as one mesh.
inline Mesh joined(Mesh a, const Mesh& b) {
  const auto base = static_cast<std::uint32_t>(a.points.size());
  a.points.insert(a.points.end(), b.points.begin(), b.points.end());
  for (const auto& [i, j, k] : b.triangles) a.triangles.push_back({base + i, base + j, base + k});
  return a;
}

}  // namespace vantage::sim
