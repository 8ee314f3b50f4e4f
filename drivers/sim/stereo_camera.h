#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "drivers/sim/renderer.h"

namespace vantage::sim {

/// The free-flying stereo pair of the paper's simulated experiment.
struct StereoOptions {
  CameraModel camera{752, 480, 448, 448, 375.5, 239.5, Distortion::kNone, {}};  ///< of both eyes
  double baseline_m = 0.1;    ///< the right eye stands at +baseline on the left one's x axis and looks the same way
  double exposure_s = 0.010;  ///< kReferenceExposure_s; more is brighter
  double noise_sigma = 2;     ///< grey levels
  std::uint64_t seed = 1;     ///< of the noise

  /// False, with the reason in `why`: a bad camera, baseline or exposure not positive, noise outside [0, 50].
  bool valid(std::string* why = nullptr) const;
};

/// Takes pictures of a world. The left eye is the reference: poses are its own.
class StereoCamera {
 public:
  /// \throws std::invalid_argument when the options are not valid.
  StereoCamera(std::shared_ptr<const Renderer> renderer, const StereoOptions& options);

  /// Takes a pair of grey images, row-major, each of `pixels()` bytes. The same seed, pose and `count` (a number of the
  /// picture, of the caller's choice) give the same bytes; another count gives other noise. An empty `right` is not
  /// taken.
  /// \throws std::invalid_argument when a buffer has another size or the pose is not rigid.
  void capture(const Eigen::Isometry3d& T_world_left, std::uint64_t count, std::span<std::uint8_t> left,
               std::span<std::uint8_t> right) const;

  /// Pose of the right eye when the left one stands at `T_world_left`.
  Eigen::Isometry3d right_pose(const Eigen::Isometry3d& T_world_left) const;

  std::size_t pixels() const;
  const StereoOptions& options() const { return options_; }
  const Renderer& renderer() const { return *renderer_; }

 private:
  std::shared_ptr<const Renderer> renderer_;
  StereoOptions options_;
};

}  // namespace vantage::sim
