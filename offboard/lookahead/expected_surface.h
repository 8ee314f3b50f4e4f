#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

namespace vantage {

/// A function of direction: spherical harmonics up to the second degree, by their coefficients.
using Lean = std::array<float, 9>;

/// Its value at a unit vector.
inline double value_at(const Lean& lean, const Eigen::Vector3d& direction) {
  const double x = direction.x(), y = direction.y(), z = direction.z();
  const double harmonics[] = {1, x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1};
  double sum = 0;
  for (std::size_t i = 0; i < lean.size(); ++i) sum += static_cast<double>(lean[i]) * harmonics[i];
  return sum;
}

/// What is expected of surface that no view has measured yet, in a box of voxels of a map; outside it, nothing is.
struct ExpectedSurface {
  Eigen::Vector3i min_corner = Eigen::Vector3i::Zero();  ///< first voxel, in voxels of the map's region
  Eigen::Vector3i size = Eigen::Vector3i::Zero();        ///< voxels
  std::vector<float> amount;  ///< 1 as in a mean voxel with surface, by x + size_x (y + size_y z)
  /// By the same voxels: logarithm of how many times as much a view measures of it as its rays and angle tell, by the
  /// direction to the camera (ExpectedViewOptions::most_lean at most). Empty: as they tell.
  std::vector<Lean> lean;

  /// Place of the map's voxel in `amount`; amount.size() outside.
  std::size_t place(const Eigen::Vector3i& voxel) const {
    const Eigen::Vector3i v = voxel - min_corner;
    if ((v.array() < 0).any() || (v.array() >= size.array()).any()) return amount.size();
    return static_cast<std::size_t>(v.x() + size.x() * (v.y() + size.y() * v.z()));
  }
};

}  // namespace vantage
