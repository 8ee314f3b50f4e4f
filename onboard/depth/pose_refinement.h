#pragma once

#include <memory>
#include <span>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "drivers/camera/frame_source.h"
#include "onboard/depth/depth_options.h"
#include "onboard/depth/pixel_belief.h"
#include "onboard/depth/worker_pool.h"

namespace vantage {

/// A frame's pose against the key frame's, as the images have it.
struct RefinedPose {
  Eigen::Isometry3d T_frame_key = Eigen::Isometry3d::Identity();  ///< lengths in units of the key frame's gauge
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  ///< perturbed on the left: shift, turn
  double misfit_px = 0;       ///< standard deviation of what no pose explains: lens, rolling shutter
  bool has_parallax = false;  ///< enough that depth can be measured in the key frame's gauge
  int corners = 0;            ///< that the pose stands on
};

/// Mends the poses that a tracker or a robot gives, by some hundred corners of the key frame found again in each frame
/// and a bundle adjustment of the latest frames in which the given poses are priors. Their stated covariance is taken
/// for an upper bound: how good they are the images tell (pose_noise.h). Exact poses stay as they were given.
///
/// A key frame has a gauge of its own: the images fix everything but the unit of length, and that unit must not change
/// while a filter sums up what frames tell. It is chosen when the parallax is large against the poses' noise. Where the
/// given poses hold it better than the corners could it is a metre; else `scale()` follows how long it is in metres,
/// from all frames' given poses and a common error of the key frame's. From a key frame's first frames on nothing is
/// taken from the heap.
class PoseRefinement {
 public:
  /// \pre options valid. `pool` must outlive it.
  PoseRefinement(const CameraModel& camera, const DepthFilterOptions& options, WorkerPool* pool);
  ~PoseRefinement();

  /// `beliefs` (row-major, metres) give corners a start where they are surer than a tenth of their value. Where most
  /// corners have one, the gauge is a metre at once, of standard deviation `scale_sigma`.
  void begin(const GreyImage& key_image, const Eigen::Matrix<double, 6, 6>& key_covariance,
             std::span<const PixelBelief> beliefs, double scale_sigma);

  /// `T_frame_key` as given; `frame_covariance` of the frame's own pose, perturbed on the left: shift, turn.
  RefinedPose refine(const GreyImage& image, const Eigen::Isometry3d& T_frame_key,
                     const Eigen::Matrix<double, 6, 6>& frame_covariance);

  /// Variances of the given poses' shifts and turns over those stated, as the images have it.
  struct Noise {
    double shift = 1, turn = 1;
  };
  Noise noise() const;

  double scale() const;        ///< metres in the gauge's unit; 1 until the parallax suffices
  double scale_sigma() const;  ///< standard deviation of it; 0 until then

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace vantage
