#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "offboard/gain/ray_bundle.h"
#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// An unknown voxel that a view would probably see.
struct ExpectedVoxel {
  std::uint32_t voxel = 0;  ///< x + size_x (y + size_y z)
  float probability = 0;    ///< that the view sees it
};

struct ExpectedViewOptions {
  double transparency = 0.5;  ///< share of the sight that an unknown voxel lets through (1 - P_o of an unobserved one)
  double least_sight = 0.05;  ///< a ray ends when less is left
};

/// What views are expected to see, one voxel at a time: a ray's sight is 1 through free voxels, halves with each
/// unknown one, and ends at an occupied one. A view sees a voxel with the largest sight of its rays. Voxels count by a
/// prior that they hold surface: 1 - d(x) / d_max for the occlusion distance d(x) behind a seen surface (Eq. 9), 0
/// without a mark.
class ExpectedViews {
 public:
  ExpectedViews(const OccupancyMap& map, const ExpectedViewOptions& options);

  /// Each voxel with a prior that the view is expected to see, once.
  std::vector<ExpectedVoxel> see(const RayBundle& rays, const Eigen::Isometry3d& T_world_camera);

  /// Prior by voxel.
  const std::vector<float>& prior() const { return prior_; }

 private:
  enum Kind : std::uint8_t { kFree, kUnknown, kOccupied };

  Region region_;
  ExpectedViewOptions options_;
  std::vector<std::uint8_t> kind_;
  std::vector<float> prior_;
  std::vector<float> sight_;  // scratch, all 0 between calls
};

}  // namespace vantage
