#pragma once

#include <span>
#include <vector>

#include "offboard/experiment/convolution.h"
#include "offboard/experiment/map_window.h"

namespace vantage {

/// A small network of the U kind (Ronneberger, Fischer and Brox, 2015; in 3D Çiçek and others, 2016) that looks at a
/// map and expects what the rest of the object is like. Learned from procedural objects (docs/experiment.md).
class SurfaceNetwork {
 public:
  static constexpr double kMost = 2;

  /// The one that the program carries.
  static const SurfaceNetwork& built_in();

  /// From the bytes of a file that scripts/learn-surface-network writes. \throws std::invalid_argument when they are
  /// not.
  explicit SurfaceNetwork(std::span<const unsigned char> file);

  /// How much surface that was not measured yet each voxel holds, 1 as in a mean voxel with surface, kMost at most:
  /// what any view would measure of it. `numbers`: MapWindow::numbers(); the answer is by the same voxels.
  std::vector<float> expect(std::span<const MapWindow::Numbers> numbers) const;

 private:
  std::vector<Convolution> layers_;
};

/// What a network expects around `focus` (world, m; map_window.h), by voxel of the map's region: x + size_x (y + size_y
/// z). `taken`: poses (T_world_camera) from which the map was measured.
std::vector<float> expect_surface(const SurfaceNetwork& network, const OccupancyMap& map, const CameraModel& camera,
                                  std::span<const Eigen::Isometry3d> taken, const Eigen::Vector3d& focus);

}  // namespace vantage
