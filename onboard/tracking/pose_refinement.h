#pragma once

#include <span>
#include <vector>

#include "calib/camera_model.h"
#include "onboard/tracking/map.h"
#include "onboard/tracking/rigid_motion.h"

namespace vantage::tracking {

/// A point of the world and where the frame saw it.
struct PoseMeasurement {
  Eigen::Vector3d position;  ///< world, m
  Eigen::Vector3d spread;    ///< world, m: one standard deviation of a position that is not certain; else zero
  Eigen::Vector2d pixel;
  double sigma_px = 1;
  bool edgelet = false;
  Eigen::Vector2d normal{1, 0};
  bool inlier = true;  ///< out
};

struct RefinedPose {
  int inliers = 0;
  double rms_px = 0;                           ///< of the inliers' weighted residuals
  Matrix6d covariance = Matrix6d::Identity();  ///< of xi in motion_exp(xi) * T_camera_world
};

/// Gauss-Newton on the reprojection error over the pose alone: Tukey's weights on the residuals' MAD scale, an edgelet
/// counts across its edge alone, an uncertain point counts less along its own uncertainty, a prior adds its
/// information.
RefinedPose refine_pose(const CameraModel& camera, std::span<PoseMeasurement> measurements,
                        const std::optional<PosePrior>& prior, Eigen::Isometry3d* T_camera_world, int iterations = 10);

/// Residual of the prior and its Jacobian: 6 numbers in units of the prior's sigmas, for
/// T_camera_world <- motion_exp(xi) * T_camera_world.
void prior_residual(const PosePrior& prior, const Eigen::Isometry3d& T_camera_world, Vector6d* residual,
                    Matrix6d* jacobian);

/// Gauss-Newton on the reprojection error over one point alone, Huber's weights. The position stays when it fails.
bool refine_point(const CameraModel& camera, const Map& map, Landmark* landmark, int iterations = 5);

}  // namespace vantage::tracking
