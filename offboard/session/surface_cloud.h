#pragma once

#include <cstdint>
#include <unordered_set>
#include <vector>

#include <Eigen/Core>

#include "lcmtypes/link/depth_map.h"
#include "offboard/mapping/region.h"

namespace vantage {

struct SurfaceCloudOptions {
  double spacing_m = 0.002;       ///< at most one point a cell of this edge
  double largest_sigma_m = 0.01;  ///< less certain pixels are left out
  double max_range_m = 1.5;       ///< along z; what lies further is left out
};

/// The reconstructed points: converged pixels of all depth maps inside the region, thinned to one a cell.
class SurfaceCloud {
 public:
  SurfaceCloud(const Region& region, const SurfaceCloudOptions& options);

  /// The points that this depth map adds, world, m. \pre depth_map.valid()
  std::vector<Eigen::Vector3f> add(const DepthMap& depth_map);

  void clear();

  const std::vector<Eigen::Vector3f>& points() const { return points_; }
  /// Unit normals of the points, on the side that was seen. From the depth map's neighbouring pixels; where those are
  /// missing, towards the camera.
  const std::vector<Eigen::Vector3f>& normals() const { return normals_; }

 private:
  Region region_;
  SurfaceCloudOptions options_;
  std::unordered_set<std::int64_t> cells_;
  std::vector<Eigen::Vector3f> points_, normals_;
};

}  // namespace vantage
