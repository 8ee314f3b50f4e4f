#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "offboard/mapping/depth_integrator.h"
#include "offboard/mapping/occupancy_map.h"
#include "offboard/mapping/tsdf.h"

namespace vantage {

/// A map together with the depth maps it was made of, so that one can be taken out, or moved when SLAM corrects its key
/// frame's pose.
///
/// Clamping forgets, so an update can't be undone by its opposite. Instead the bricks that the image speaks of, before
/// or after the correction, are emptied and the kept images integrated into them again in their order; every brick
/// depends on itself alone, so the map is as if it had been integrated so at once.
class DepthHistory {
 public:
  /// \throws std::invalid_argument when an argument is not valid. Without `tsdf` none is kept.
  DepthHistory(const Region& region, const SensorModel& model, const std::optional<TsdfOptions>& tsdf = {});

  /// Integrates a depth map and keeps it under `id`. Refuses an id that is taken, and what integrate refuses.
  IntegrationResult add(std::int64_t id, DepthMap depth_map);
  /// Takes a depth map out again. Refuses an unknown id.
  IntegrationResult remove(std::int64_t id);
  /// Gives a depth map another pose, at its place in the order. Refuses an unknown id and a pose that is not rigid.
  IntegrationResult correct(std::int64_t id, const Eigen::Isometry3d& T_world_camera);
  /// Integrates all kept depth maps anew.
  void rebuild();

  const OccupancyMap& map() const { return map_; }
  const Tsdf* tsdf() const { return tsdf_ ? &*tsdf_ : nullptr; }
  std::size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    std::int64_t id;
    DepthMap depth_map;
  };

  std::vector<Entry>::iterator find(std::int64_t id);
  IntegrationResult rebuild_bricks(const std::vector<std::uint8_t>& bricks);

  OccupancyMap map_;
  std::optional<Tsdf> tsdf_;
  std::vector<Entry> entries_;
  IntegrationScratch scratch_;
};

}  // namespace vantage
