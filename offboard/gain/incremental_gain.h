#pragma once

#include <cstdint>
#include <vector>

#include "offboard/gain/gain_evaluator.h"

namespace vantage {

/// Gains of a fixed set of views, kept up to date with a map that grows.
///
///     IncrementalGain gains(map, rays, candidates, options);
///     while (...) { map.integrate(depth_map); choose(gains.update()); }
///
/// After an integration only the blocks of rays that pass through a changed brick are cast again. The result equals the
/// full evaluation (evaluate_views) to the bit. The map must stay where it is and be changed by its own updates alone;
/// after another map was assigned to it, make a new IncrementalGain.
class IncrementalGain {
 public:
  /// Holds a reference to `map`. \throws std::invalid_argument when the options are not valid.
  IncrementalGain(const OccupancyMap& map, const RayBundle& rays, std::vector<Eigen::Isometry3d> T_world_cameras,
                  const GainOptions& options = {});

  /// Gains of all views as the map is now.
  std::vector<ViewGain> update();

  /// Share of the blocks of rays that the last update cast again.
  double recast_share() const { return recast_share_; }

 private:
  /// A set of cells (groups of bricks) of the region.
  using Cells = std::array<std::uint64_t, 64>;

  std::size_t cell_of(const std::array<std::int32_t, 3>& brick) const;
  void trace_rays();

  const OccupancyMap& map_;
  GainEvaluator evaluator_;
  std::vector<Eigen::Isometry3d> poses_;
  GainField field_;
  int log2_bricks_per_cell_ = 0;
  std::array<std::int32_t, 3> size_cells_{};
  std::vector<Cells> passes_;  // by view, then block: the cells that its rays pass
  std::vector<RaySums> sums_;  // by view, then block
  bool fresh_ = true;          // nothing cast yet
  double recast_share_ = 1;
};

}  // namespace vantage
