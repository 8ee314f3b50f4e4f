#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "offboard/gain/ray_bundle.h"
#include "offboard/lookahead/expected_surface.h"
#include "offboard/lookahead/voxel_surroundings.h"
#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// An unknown voxel that a view would probably see.
struct ExpectedVoxel {
  std::uint32_t voxel = 0;                              ///< Region::index_of
  float probability = 0;                                ///< that the view measures the surface in it, if it holds some
  Eigen::Vector3f to_camera = Eigen::Vector3f::Zero();  ///< unit vector; zero when it does not matter
};

/// A view that was taken, and what it was expected to see then (nothing, for a view that nobody chose).
struct TakenView {
  Eigen::Vector3d position;  ///< of the camera, world, m
  std::vector<ExpectedVoxel> expected;
};

/// Numbers found in runs on procedural objects (docs/lookahead.md).
struct ExpectedViewOptions {
  double ground_m = 0;        ///< height of what the object stands on, world
  double opacity = 0.65;      ///< share of the sight that is lost on a voxel's length of way through expected surface
  double least_prior = 0.01;  ///< where less is expected, nothing is: half of the voxels, a hundredth of the surface
  double least_sight = 0.05;  ///< a ray ends when less is left

  // Block matching measures what faces the camera, and misses what it sees at a slant.
  double detected_facing = 0.95;  ///< share that is measured of what faces the camera
  double slant_exponent = 2.2;    ///< at the cosine c: detected_facing (1 - (1 - c)^slant_exponent), and
  double detected_averted = 0.1;  ///< never less than this, which holds of what faces away
  double detected_unknown = 0.7;  ///< where it is not known which way it faces
  double most_detected = 0.98;
  double most_lean = 3;      ///< as learned with
  double miss_exponent = 8;  ///< what was missed is missed again, times cos^miss_exponent of the views' angle
};

/// What views are expected to measure, one voxel at a time. A ray's sight is 1 at first; a voxel that holds surface
/// with probability P leaves 1 - opacity P l of it when the ray's way through it is l voxels long (counted whole, a ray
/// along an axis would see farther than an oblique one, which meets more voxels on the same way), an occupied one and
/// the ground nothing. A view measures a voxel with the largest sight of its rays, times the share that is detected at
/// the angle, times what the network knows better (ExpectedSurface::lean).
class ExpectedViews {
 public:
  /// Its amounts count in unknown voxels near occupied ones, as probabilities. `surface`, `taken` (the map's views):
  /// must outlive it.
  ExpectedViews(const OccupancyMap& map, const ExpectedSurface& surface, std::span<const TakenView> taken,
                const ExpectedViewOptions& options = {});

  /// Rays as far apart as voxels are in the middle of what is expected: with a fixed number a view from farther off
  /// would miss more of the voxels that it sees. Kept for the next view as far off. \pre always the same camera
  const RayBundle& rays_for(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera);

  /// Each voxel with a prior that the view is expected to see, once.
  std::vector<ExpectedVoxel> see(const RayBundle& rays, const Eigen::Isometry3d& T_world_camera);

  /// Probability that it holds surface not yet measured, by voxel.
  const std::vector<float>& prior() const { return prior_; }

 private:
  void enclose();
  void list_misses();
  double detected(std::uint32_t voxel, const Eigen::Vector3d& to_camera) const;
  double not_missed_again(std::uint32_t voxel, const Eigen::Vector3d& to_camera) const;

  Region region_;
  const ExpectedSurface& surface_;
  ExpectedViewOptions options_;
  std::vector<float> prior_;
  VoxelSurroundings surroundings_;
  std::span<const TakenView> taken_;
  struct Miss {
    Eigen::Vector3f to_camera;  // unit vector
    float probability;          // with which it should have been measured
  };
  std::vector<std::uint32_t> first_miss_;  // by voxel, and the end
  std::vector<Miss> misses_;
  Eigen::Vector3i box_min_, box_size_;             // voxels: holds all that is expected or occupied above the ground
  std::map<std::pair<int, int>, RayBundle> rays_;  // by columns and rows
  std::vector<float> sight_;                       // scratch, all 0 between calls
};

}  // namespace vantage
