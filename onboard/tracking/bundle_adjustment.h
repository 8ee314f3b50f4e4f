#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/camera_model.h"
#include "onboard/tracking/map.h"

namespace vantage::tracking {

struct AdjustedPose {
  Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
  bool fixed = false;
  std::optional<PosePrior> prior;
};

struct AdjustedObservation {
  int pose = 0;   ///< index into the problem's poses
  int point = 0;  ///< into its points
  Eigen::Vector2d pixel{0, 0};
  double sigma_px = 1;
  bool edgelet = false;
  Eigen::Vector2d normal{1, 0};
  bool inlier = true;  ///< out: within 2.5 sigma and in front of the camera
};

struct AdjustmentProblem {
  std::vector<AdjustedPose> poses;
  std::vector<Eigen::Vector3d> points;
  std::vector<AdjustedObservation> observations;
  /// Keeps the distance between these two poses, for a problem without metric information and one fixed pose.
  std::optional<std::pair<int, int>> kept_distance;
};

struct AdjustmentOptions {
  int iterations = 6;
  double huber = 1.5;  ///< sigmas
  double seconds = 0;  ///< gives up improving after this long; 0: never
  bool valid(std::string* why = nullptr) const;
};

struct AdjustmentSummary {
  bool usable = false;
  double rms = 0;  ///< of the inliers' residuals, sigmas
  int outliers = 0;
};

/// Bundle adjustment: poses and points that make all reprojection errors small (Huber), with Ceres' Levenberg-Marquardt
/// on the Schur complement, one thread. Moves the problem's poses and points; judges every observation. A kept distance
/// is a soft one, of a relative 1e-4.
AdjustmentSummary adjust(const CameraModel& camera, AdjustmentProblem* problem, const AdjustmentOptions& options = {});

}  // namespace vantage::tracking
