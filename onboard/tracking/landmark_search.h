#pragma once

#include "calib/camera_model.h"
#include "onboard/tracking/map.h"
#include "onboard/tracking/patch_alignment.h"

namespace vantage::tracking {

/// How a landmark's surroundings look from another camera.
struct WarpedPatch {
  BorderedPatch patch;
  int level = 0;  ///< of the current image on which the patch has about its own resolution
  Eigen::Matrix2d A_current_reference = Eigen::Matrix2d::Identity();  ///< level-0 pixels
};

/// Warps the patch around `pixel` (found on `level`) of the reference into the current view, for a plane at
/// `distance_m` along `ray` that faces the reference (Forster et al. 2014). False when it reaches out of the image or
/// is seen too slantingly. `extra_levels` searches on a coarser level than need be.
bool warp_into(const CameraModel& camera, const ImagePyramid& reference, const Eigen::Vector2d& pixel, int level,
               const Eigen::Vector3d& ray, double distance_m, const Eigen::Isometry3d& T_current_reference,
               WarpedPatch* warped, int extra_levels = 0);

/// Seeks a landmark where it should be in an image: the patch comes from its host, or from the key frame with the
/// closest direction of view when the host's differs by more than 30 degrees. False when it does not lie in the image,
/// is seen from over 60 degrees aside, does not converge or looks different. Allocates nothing.
bool find_landmark(const CameraModel& camera, const Map& map, const Landmark& landmark, const ImagePyramid& current,
                   const Eigen::Isometry3d& T_current_world, Feature* feature);

enum class SeedUpdate {
  kUpdated,
  kNoMatch,
  kNotVisible  ///< or moved along its own edge: nothing could be learnt
};

/// Seeks a seed along its epipolar segment (mu +- 2 sigma) in an image: steps of 0.7 px with normalised correlation,
/// then sub-pixel. kUpdated stands for found.
SeedUpdate find_seed(const CameraModel& camera, const KeyFrame& host, const ImagePyramid& current,
                     const Eigen::Isometry3d& T_current_world, const Landmark& seed, Feature* feature);

/// One step of the depth filter: finds the seed in a posed image, triangulates, and updates the belief with the
/// variance that half a pixel of the level would cause.
SeedUpdate update_seed(const CameraModel& camera, const KeyFrame& host, const ImagePyramid& current,
                       const Eigen::Isometry3d& T_current_world, Landmark* seed);

}  // namespace vantage::tracking
