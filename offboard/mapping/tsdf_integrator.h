#pragma once

#include <vector>

#include "lcmtypes/link/depth_map.h"
#include "offboard/mapping/tsdf.h"
#include "offboard/mapping/voxel_projection.h"

namespace vantage {

/// Puts one depth image into the bricks of a TSDF that the occupancy's integration leads it to.
class TsdfIntegrator {
 public:
  /// `surface`: DepthLookup::surface() of the depth map.
  TsdfIntegrator(const DepthMap& depth_map, const std::vector<float>& surface, Tsdf* tsdf);

  /// Measures the brick's voxels against the surface; `projection.first` is the brick's. Allocates the brick when a
  /// voxel lies within the truncation distance of the surface.
  void integrate(std::size_t brick, const VoxelProjection& projection);

 private:
  /// Depth of the surface at a pixel position between four pixels, and their variance; false when one says nothing or
  /// they lie on two surfaces.
  bool surface_at(float u, float v, float* depth, float* sigma) const;

  const DepthMap& depth_map_;
  const std::vector<float>& surface_;
  Tsdf& tsdf_;
  float truncation_, jump_, reference_sigma_;
};

}  // namespace vantage
