#pragma once

#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "onboard/tracking/image_pyramid.h"
#include "onboard/tracking/rigid_motion.h"

namespace vantage::tracking {

/// A point of the reference frame: where it was seen (level 0) and where it is (reference camera's frame, m).
struct AlignmentPoint {
  Eigen::Vector2d pixel;
  Eigen::Vector3d point;
};

/// What is known of a motion before the images are looked at.
struct MotionPrior {
  Eigen::Isometry3d T_current_reference = Eigen::Isometry3d::Identity();
  double sigma_translation_m = 1e9;
  double sigma_rotation_rad = 1e9;
};

struct AlignmentOptions {
  int coarsest_level = 3;
  int finest_level = 1;
  int iterations = 10;  ///< at most, a level
};

struct AlignmentResult {
  Eigen::Isometry3d T_current_reference = Eigen::Isometry3d::Identity();
  double gain = 1, offset = 0;  ///< current = gain * reference + offset
  int visible = 0;              ///< patches seen by both
  double rms = 0;               ///< robust: median over the patches of their root mean square residual, grey levels
};

/// Sparse image alignment: the motion that makes the 4 x 4 pixels around every point look the same in both images.
///
/// Inverse compositional Gauss-Newton over the motion, one gain and one offset, coarse to fine (Forster et al. 2014),
/// with a Student-t weight (5 degrees of freedom) on every patch, whose scale is the median of their residuals, and a
/// Gaussian prior on the motion. Keeps its memory: allocates nothing once it has seen as many points.
class SparseAlignment {
 public:
  explicit SparseAlignment(const CameraModel& camera) : camera_(camera) {}

  AlignmentResult align(const ImagePyramid& reference, std::span<const AlignmentPoint> points,
                        const ImagePyramid& current, const Eigen::Isometry3d& T_current_reference,
                        const MotionPrior& prior = {}, const AlignmentOptions& options = {});

 private:
  struct Patch {
    Eigen::Vector3d point;
    Eigen::Matrix<float, 8, 8> hessian;
    alignas(16) float jacobian[16][8];  // d grey / d motion (6), grey, 1
    float rms;
    bool visible;
  };

  void prepare(const ImageView& reference, int level, std::span<const AlignmentPoint> points);
  /// Residuals at a motion; fills rms and visible of every patch and, per patch, K^T r.
  double residuals(const ImageView& current, int level, const Eigen::Isometry3d& T_current_reference, double gain,
                   double offset);

  CameraModel camera_;
  std::vector<Patch> patches_;
  std::vector<Eigen::Matrix<float, 8, 1>> gradients_;
  std::vector<float> sorted_;
};

}  // namespace vantage::tracking
