#pragma once

#include <vector>

#include <Eigen/Core>

#include "calib/camera_model.h"

namespace vantage {

/// The rays R_v of a view: unit vectors of the camera frame.
///
///     RayBundle rays(camera, 80, 60);  // ranks views as every pixel would, at 1/64 of the cost (docs/gain.md)
class RayBundle {
 public:
  /// `columns` x `rows` rays at the centres of as many equal cells of the image; a cell whose centre the lens sees
  /// nothing through is left out. Rays are ordered by tiles of 4 x 4, so that neighbours in the list are neighbours in
  /// the image.
  /// \throws std::invalid_argument when the camera is not valid or a number is not in [1, 4096].
  RayBundle(const CameraModel& camera, int columns, int rows);

  /// Any rays; they are normalised. \throws std::invalid_argument when one is zero or not finite.
  explicit RayBundle(std::vector<Eigen::Vector3d> directions);

  const std::vector<Eigen::Vector3d>& directions() const { return directions_; }
  std::size_t size() const { return directions_.size(); }

 private:
  std::vector<Eigen::Vector3d> directions_;
};

}  // namespace vantage
