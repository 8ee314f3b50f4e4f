#pragma once

#include <span>
#include <vector>

#include "offboard/lookahead/convolution.h"
#include "offboard/lookahead/expected_surface.h"
#include "offboard/lookahead/map_window.h"

namespace vantage {

/// A small network of the U kind (Ronneberger, Fischer and Brox, 2015; in 3D Çiçek and others, 2016) that looks at a
/// map and expects what the rest of the object is like. Learned from procedural objects (docs/lookahead.md).
class SurfaceNetwork {
 public:
  static constexpr double kMost = 2;

  /// The one that the program carries.
  static const SurfaceNetwork& built_in();

  /// From the bytes of a file that scripts/learn-surface-network writes. \throws std::invalid_argument when they are
  /// not.
  explicit SurfaceNetwork(std::span<const unsigned char> file);

  /// By voxel of the window, that begins at voxel 0. The amount is what any view would measure, kMost at most.
  /// `numbers`: MapWindow::numbers().
  ExpectedSurface expect(std::span<const MapWindow::Numbers> numbers) const;
  /// The same, where the window is in the map.
  ExpectedSurface expect(const MapWindow& window) const;

 private:
  std::vector<Convolution> layers_;
};

}  // namespace vantage
