#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "offboard/gain/cast_kernel.h"
#include "offboard/gain/gain_field.h"
#include "offboard/gain/ray_bundle.h"
#include "offboard/gain/view_gain.h"

namespace vantage {

/// Evaluates sets of views with one bundle of rays; what evaluate_views (view_gain.h) stands on.
class GainEvaluator {
 public:
  /// \throws std::invalid_argument when the options are not valid.
  GainEvaluator(const RayBundle& rays, const GainOptions& options);

  /// Gains of views through a map. Encodes the map first.
  std::vector<ViewGain> evaluate(const OccupancyMap& map, std::span<const Eigen::Isometry3d> T_world_cameras) const;

  /// The same through a field that holds what the map holds.
  std::vector<ViewGain> evaluate(const OccupancyMap& map, const GainField& field,
                                 std::span<const Eigen::Isometry3d> T_world_cameras) const;

  std::size_t block_count() const { return x_.size() / kRaysPerBlock; }
  RayColumns columns() const { return {x_.data(), y_.data(), z_.data(), rays_.size()}; }
  const GainOptions& options() const { return options_; }

  /// The walk's constants of a view.
  static GridWalk walk_of(const OccupancyMap& map, const Eigen::Isometry3d& T_world_camera);

  /// Casts the blocks for which `stale` is not 0 (all when it is empty), view by view, into `sums`; both have an
  /// element for every block of every view. Views with a bad pose are passed over. The field must fit.
  void cast(const OccupancyMap& map, const GainField& field, std::span<const Eigen::Isometry3d> T_world_cameras,
            std::span<const std::uint8_t> stale, std::span<RaySums> sums) const;

  /// Gain of a view from its blocks' sums, added in order.
  ViewGain gain_of_blocks(const OccupancyMap& map, const Eigen::Isometry3d& T_world_camera,
                          std::span<const RaySums> sums) const;

 private:
  RayBundle rays_;
  GainOptions options_;
  CastKernel kernel_;
  std::vector<double> x_, y_, z_;  // directions, padded to whole blocks
};

}  // namespace vantage
