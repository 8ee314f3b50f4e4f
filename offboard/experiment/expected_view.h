#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "offboard/experiment/surface_prior.h"
#include "offboard/gain/ray_bundle.h"
#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// An unknown voxel that a view would probably see.
struct ExpectedVoxel {
  std::uint32_t voxel = 0;  ///< x + size_x (y + size_y z)
  float probability = 0;    ///< that the view measures the surface in it, if it holds some
};

/// Numbers found with the table of surface_prior.h, in the same runs.
struct ExpectedViewOptions {
  double opacity = 0.5;       ///< share of the sight that a voxel with surface takes: it fills a part of the voxel
  double least_sight = 0.05;  ///< a ray ends when less is left

  // Block matching measures what faces the camera, and misses what it sees at a slant.
  double detected_facing = 0.95;  ///< share that is measured of what faces the camera
  double slant_exponent = 2.2;    ///< at the cosine c: detected_facing (1 - (1 - c)^slant_exponent), and
  double detected_averted = 0.1;  ///< never less than this, which holds of what faces away
  double detected_unknown = 0.7;  ///< where it is not known which way it faces
};

/// What views are expected to measure, one voxel at a time. A ray's sight is 1 at first; a voxel that holds surface
/// with probability P (surface_prior.h) leaves 1 - opacity P of it, an occupied one and the ground nothing. A view
/// measures a voxel with the largest sight of its rays, times the share that is detected at the angle.
class ExpectedViews {
 public:
  ExpectedViews(const OccupancyMap& map, const ExpectedViewOptions& options);

  /// Multiplies the prior by `left`, by voxel: the probability that views already taken would have missed it.
  void lessen(std::span<const float> left);

  /// Each voxel with a prior that the view is expected to see, once.
  std::vector<ExpectedVoxel> see(const RayBundle& rays, const Eigen::Isometry3d& T_world_camera);

  /// Probability that it holds surface not yet seen, by voxel.
  const std::vector<float>& prior() const { return prior_; }

 private:
  double detected(std::size_t voxel, const Eigen::Vector3d& camera) const;

  Region region_;
  ExpectedViewOptions options_;
  SurfacePrior surface_;
  std::vector<float> prior_;
  std::vector<float> sight_;  // scratch, all 0 between calls
};

}  // namespace vantage
