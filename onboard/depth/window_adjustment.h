#pragma once

#include <span>
#include <vector>

#include <Eigen/Dense>

#include "calib/camera_model.h"
#include "onboard/depth/corner_tracks.h"

namespace vantage {

/// A frame in the adjustment. Poses are T_frame_key; lengths are in whatever unit the caller keeps.
struct AdjustedView {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d prior = Eigen::Isometry3d::Identity();
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();  ///< of the prior: shift, turn
  std::vector<PatchPlace> places;                                                 ///< where each corner was found
};

/// A corner of the key frame.
struct AdjustedCorner {
  Eigen::Vector3d ray;                     ///< z = 1
  double inverse = 0;                      ///< depth along z, 1 / unit
  double prior_mean = 0, prior_sigma = 1;  ///< of it
};

/// exp(d) T for d = (shift, turn): the shift is added as it is, the turn by Rodrigues' formula.
Eigen::Isometry3d moved(const Eigen::Isometry3d& T, const Eigen::Matrix<double, 6, 1>& d);

/// Bundle adjustment of a few frames against one key frame: poses with priors, one inverse depth a corner, Huber's cost
/// on pixels. Levenberg-Marquardt; the corners are eliminated (Schur complement).
class WindowAdjustment {
 public:
  /// Inverse depths never go beyond `low` and `high`.
  WindowAdjustment(const CameraModel& camera, double low, double high) : camera_(camera), low_(low), high_(high) {}

  /// Adjusts poses and corners for at most `iterations` steps; returns the cost reached (half the sum of squares,
  /// sigmas).
  double run(std::span<AdjustedView*> views, std::vector<AdjustedCorner>& corners, double pixel_sigma, int iterations);

  /// The corners alone, the poses held.
  void run_structure(std::span<AdjustedView*> views, std::vector<AdjustedCorner>& corners, double pixel_sigma,
                     int iterations);

  /// Covariance of the last view's pose, (shift, turn) on the left; after `run`, of the same views.
  Eigen::Matrix<double, 6, 6> last_covariance() const;

  /// Standard deviation of the residuals, pixels, by their median: not led astray by wrong places. 0 without any.
  double residual_sigma(std::span<AdjustedView*> views, const std::vector<AdjustedCorner>& corners);

 private:
  struct Elimination {
    double information = 0, gradient = 0;
    Eigen::VectorXd coupling;
  };

  double linearise(std::span<AdjustedView*> views, const std::vector<AdjustedCorner>& corners, double pixel_sigma);
  double cost(std::span<AdjustedView*> views, const std::vector<AdjustedCorner>& corners, double pixel_sigma) const;

  CameraModel camera_;
  double low_, high_;
  Eigen::MatrixXd H_;  ///< lower triangle
  Eigen::VectorXd g_;
  std::vector<Elimination> eliminated_;
  std::vector<double> lengths_;
};

}  // namespace vantage
