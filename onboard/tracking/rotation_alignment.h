#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "onboard/tracking/image_pyramid.h"

namespace vantage::tracking {

/// The rotation between two images as a whole, from a coarse level of some 40 x 30 pixels, of which several may lie
/// between them. Right when the camera has only turned, and a good start otherwise (the small blurry images of Klein
/// and Murray 2008). Inverse compositional over rotation, gain and offset. Allocates nothing.
class RotationAlignment {
 public:
  explicit RotationAlignment(const CameraModel& camera);

  struct Result {
    Eigen::Matrix3d R_current_reference = Eigen::Matrix3d::Identity();
    double correlation = -1;  ///< of the overlapping part
  };
  Result align(const ImagePyramid& reference, const ImagePyramid& current,
               const Eigen::Matrix3d& R_current_reference = Eigen::Matrix3d::Identity());

 private:
  struct Sample {
    Eigen::Vector3f ray;
    Eigen::Matrix<float, 2, 3> motion;  // d pixel of the level / d rotation
    int u, v;
  };
  CameraModel camera_;
  int level_;  ///< the coarsest with thirty pixels in either direction
  std::vector<Sample> samples_;
  std::vector<Eigen::Matrix<float, 5, 1>> jacobians_;
};

}  // namespace vantage::tracking
