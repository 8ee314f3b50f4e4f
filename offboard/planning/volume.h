#pragma once

#include "offboard/mapping/depth_integrator.h"
#include "offboard/mapping/occupancy_map.h"
#include "offboard/mapping/tsdf.h"

namespace vantage {

/// What a session knows of the region: occupancy to plan by, and the signed distance to mesh, from the same depth maps.
class Volume {
 public:
  /// \throws std::invalid_argument when the region or the model is not valid.
  Volume(const Region& region, const SensorModel& model) : map_(region, model), tsdf_(region) {}

  /// Puts a depth map into both; see integrate_depth_map.
  IntegrationResult integrate(const DepthMap& depth_map) {
    return integrate_depth_map(depth_map, &map_, &tsdf_, &scratch_);
  }

  /// Forgets all of them.
  void clear() {
    map_.clear();
    tsdf_.clear();
  }

  const OccupancyMap& map() const { return map_; }
  const Tsdf& tsdf() const { return tsdf_; }

 private:
  OccupancyMap map_;
  Tsdf tsdf_;
  IntegrationScratch scratch_;
};

}  // namespace vantage
