#pragma once

#include <memory>
#include <vector>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "drivers/sim/world.h"

namespace vantage::sim {

/// Samples of a pixel; their places in it are the same in every pixel.
inline constexpr int kSamplesPerPixel = 4;

/// What an ideal camera sees of a world: no noise, no rounding, no saturation.
///
/// Pixels are shared out to `threads` threads (0: as many as the machine has), which does not change a bit of the
/// result. Const functions may be called by several threads at once.
///
///     Renderer renderer(World{load_mesh("models/teapot.ply")});
///     std::vector<float> radiance, depth_m;
///     renderer.render(camera, look_at({0.6, 0, 0.35}, {0, 0, 0.1}), &radiance);
///     renderer.depth(camera, T_world_camera, &depth_m);
class Renderer {
 public:
  explicit Renderer(const World& world, int threads = 0);
  ~Renderer();

  /// Radiance of every pixel, row-major, width x height of `camera`; 1 is white at the reference exposure (sensor.h).
  /// Mean of four rays a pixel; a lamp's shadow, diffuse surfaces. Where nothing is (over the walls) it is 0.
  /// Pixels outside a lens's range (CameraModel::unproject) are 0 as well.
  void render(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera, std::vector<float>* radiance) const;

  /// Exact depth along the camera's z axis (m) of what the centre of every pixel sees, to float precision (1e-6 of the
  /// distance); infinity where there is nothing.
  void depth(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera, std::vector<float>* depth_m) const;

 private:
  struct Implementation;
  std::unique_ptr<const Implementation> implementation_;
};

}  // namespace vantage::sim
