#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>

namespace vantage {

/// The region of interest: an axis-parallel box of cubic voxels in the world frame.
///
/// Voxel (i, j, k) is the half-open cube [min_corner + r (i, j, k), min_corner + r (i + 1, j + 1, k + 1)), r being
/// `resolution_m`. The default is the paper's: 1.28 m at 1 cm.
struct Region {
  static constexpr int kMaxSizeVoxels = 1024;  ///< an edge; OctoMap's keys and the ray walk's fixed point hold it

  Eigen::Vector3d min_corner{-0.64, -0.64, -0.64};  ///< world, m
  Eigen::Vector3i size_voxels{128, 128, 128};
  double resolution_m = 0.01;  ///< edge of a voxel

  /// Cube around `center`, its corner moved to the next multiple of the resolution (OctoMap's grid).
  /// The edge is rounded to whole voxels.
  static Region cube(const Eigen::Vector3d& center, double edge_m, double resolution_m);

  /// False, with the reason in `why`: a number that is not finite, a resolution that is not positive, an edge of less
  /// than one or more than kMaxSizeVoxels voxels.
  bool valid(std::string* why = nullptr) const;

  /// True when the corner is a multiple of the resolution (to 1e-6 voxel): the grid is then OctoMap's.
  bool aligned() const;

  Eigen::Vector3d max_corner() const { return min_corner + resolution_m * size_voxels.cast<double>(); }
  std::int64_t voxel_count() const {
    return std::int64_t{size_voxels.x()} * std::int64_t{size_voxels.y()} * std::int64_t{size_voxels.z()};
  }

  bool contains(const Eigen::Vector3i& voxel) const {
    return (voxel.array() >= 0).all() && (voxel.array() < size_voxels.array()).all();
  }
  /// Place of a voxel of the region in an array of all: x + size_x (y + size_y z).
  std::uint32_t index_of(const Eigen::Vector3i& voxel) const {
    return static_cast<std::uint32_t>(voxel.x() + size_voxels.x() * (voxel.y() + size_voxels.y() * voxel.z()));
  }
  /// The voxel at that place.
  Eigen::Vector3i voxel_of(std::uint32_t index) const {
    const auto width = static_cast<std::uint32_t>(size_voxels.x()), depth = static_cast<std::uint32_t>(size_voxels.y());
    const std::uint32_t row = index / width, layer = row / depth;
    return Eigen::Matrix<std::uint32_t, 3, 1>(index - row * width, row - layer * depth, layer).cast<int>();
  }
  /// Centre of a voxel, world, m.
  Eigen::Vector3d center(const Eigen::Vector3i& voxel) const {
    return min_corner + resolution_m * (voxel.cast<double>().array() + 0.5).matrix();
  }
  /// Coordinates in voxels from the region's corner.
  Eigen::Vector3d to_voxels(const Eigen::Vector3d& point) const { return (point - min_corner) / resolution_m; }
  /// Voxel that holds a point of the world. False, and nothing written, when it lies outside or is not finite.
  bool voxel_at(const Eigen::Vector3d& point, Eigen::Vector3i* voxel) const;

  bool operator==(const Region& other) const {
    return min_corner == other.min_corner && size_voxels == other.size_voxels && resolution_m == other.resolution_m;
  }
};

}  // namespace vantage
