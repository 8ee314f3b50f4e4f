#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Dense>

#include "calib/camera_model.h"
#include "onboard/depth/corner_tracks.h"
#include "onboard/depth/pose_noise.h"

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

/// Bundle adjustment of up to kMostPoses frames against one key frame: poses with priors, one inverse depth a corner,
/// Huber's cost on pixels. Levenberg-Marquardt; the corners are eliminated (Schur complement). Takes nothing from the
/// heap once it has the room.
class WindowAdjustment {
 public:
  /// Inverse depths never go beyond `low` and `high`.
  WindowAdjustment(const CameraModel& camera, double low, double high) : camera_(camera), low_(low), high_(high) {}

  /// Takes the room for so many corners at once.
  void reserve(std::size_t corners);

  /// Adjusts poses and corners for at most `iterations` steps; returns the cost reached (half the sum of squares,
  /// sigmas).
  double run(std::span<AdjustedView* const> views, std::vector<AdjustedCorner>& corners, double pixel_sigma,
             int iterations);

  /// The corners alone, the poses held.
  void run_structure(std::span<AdjustedView* const> views, std::vector<AdjustedCorner>& corners, double pixel_sigma,
                     int iterations);

  /// Covariance of the last view's pose, (shift, turn) on the left; after `run`, of the same views.
  Eigen::Matrix<double, 6, 6> last_covariance() const;

  /// What the images say of the priors' errors; after `run`, of the same views.
  void weigh(std::span<AdjustedView* const> views, PoseEvidence* evidence) const;

  /// Standard deviation of a corner's inverse depth over its value, by the median, were the poses known; after `run`.
  double corner_sigma(const std::vector<AdjustedCorner>& corners);

  /// Standard deviation of the residuals, pixels, by their median: not led astray by wrong places. 0 without any.
  double residual_sigma(std::span<AdjustedView* const> views, const std::vector<AdjustedCorner>& corners);

 private:
  struct Elimination {
    double information = 0, gradient = 0;
    PosesVector coupling;
  };

  double linearise(std::span<AdjustedView* const> views, const std::vector<AdjustedCorner>& corners,
                   double pixel_sigma);
  double cost(std::span<AdjustedView* const> views, const std::vector<AdjustedCorner>& corners,
              double pixel_sigma) const;

  CameraModel camera_;
  double low_, high_;
  PosesMatrix H_, damped_;  ///< lower triangles
  PosesVector g_;
  std::array<Eigen::Isometry3d, kMostPoses> poses_;
  std::vector<double> inverses_;
  std::vector<Elimination> eliminated_;
  std::vector<double> lengths_;
};

}  // namespace vantage
