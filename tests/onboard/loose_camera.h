#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "drivers/camera/frame_source.h"
#include "drivers/sim/renderer.h"
#include "drivers/sim/sensor.h"
#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// An octahedron that stands on a corner: slanted faces and sharp edges against ground and walls.
inline sim::World world_with_octahedron(std::uint32_t seed) {
  sim::World world;
  sim::Mesh& mesh = world.object;
  mesh.points = {{0.15F, 0, 0.15F}, {-0.15F, 0, 0.15F}, {0, 0.15F, 0.15F}, {0, -0.15F, 0.15F}, {0, 0, 0.3F}, {0, 0, 0}};
  for (std::uint32_t i = 0; i < 8; ++i) mesh.triangles.push_back({i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2)});
  world.texture_seed = seed;
  return world;
}

/// A camera on a carrier that stands 2 mm and 0.2 degrees from where it says, each coordinate, anew for each exposure.
class LooseCamera {
 public:
  explicit LooseCamera(std::uint32_t seed) : renderer_(world_with_octahedron(seed)), random_(seed) {}

  static CameraModel model() { return {376, 240, 224, 224, 187.5, 119.5, Distortion::kNone, {}}; }

  Frame frame_at(const Eigen::Isometry3d& said) {
    Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
    error.translation() = draw(sigma_m);
    const Eigen::Vector3d turn = draw(sigma_rad);
    if (turn.norm() > 0) error.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    true_pose_ = said * error;
    const CameraModel camera = model();
    std::vector<float> radiance;
    renderer_.render(camera, true_pose_, &radiance);
    auto pixels = std::make_shared<std::vector<std::uint8_t>>(radiance.size());
    const double light = covered ? 0 : sim::kReferenceExposure_s;
    sim::expose(radiance, light, 2, sim::noise_key(1, ++count_, 0), *pixels);
    Frame frame;
    frame.capture_time_ns = static_cast<std::int64_t>(count_) * 33'000'000;
    frame.sequence = count_;
    frame.image = {camera.width, camera.height, camera.width, {pixels, pixels->data()}};
    frame.T_world_camera = said;
    return frame;
  }
  /// Of the last exposure.
  const Eigen::Isometry3d& true_pose() const { return true_pose_; }
  std::vector<float> depth_from(const Eigen::Isometry3d& pose) const {
    std::vector<float> depth;
    renderer_.depth(model(), pose, &depth);
    return depth;
  }

  double sigma_m = 0.002, sigma_rad = 0.0035;
  bool covered = false;

 private:
  Eigen::Vector3d draw(double sigma) {
    const double x = sigma * normal_(random_), y = sigma * normal_(random_);
    return {x, y, sigma * normal_(random_)};
  }

  sim::Renderer renderer_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::uint64_t count_ = 0;
  Eigen::Isometry3d true_pose_ = Eigen::Isometry3d::Identity();
};

/// How good a map is, where the truth lies within 3 m.
struct Quality {
  double measured = 0;      ///< share of the pixels
  double right = 0;         ///< of those measured, within 3 % or three of the map's sigmas
  double median_error = 0;  ///< relative
  double off_m = 0, off_rad = 0;
};

inline Quality quality_of(const DepthMap& map, const LooseCamera& camera, const Eigen::Isometry3d& T_world_camera) {
  const std::vector<float> truth = camera.depth_from(T_world_camera);
  std::vector<double> errors;
  std::size_t known = 0, right = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!(truth[i] < 3)) continue;
    ++known;
    if (map.state[i] != DepthState::kConverged) continue;
    errors.push_back(std::abs(static_cast<double>(map.depth_m[i]) / static_cast<double>(truth[i]) - 1));
    right += errors.back() < std::max(0.03, 3 * static_cast<double>(map.sigma_m[i]) / static_cast<double>(truth[i]));
  }
  Quality quality;
  const auto count = static_cast<double>(errors.size());
  quality.measured = count / static_cast<double>(known);
  if (errors.empty()) return quality;
  quality.right = static_cast<double>(right) / count;
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  quality.median_error = *middle;
  const Eigen::Isometry3d error = T_world_camera.inverse() * map.T_world_camera;
  quality.off_m = error.translation().norm();
  quality.off_rad = Eigen::AngleAxisd(error.linear()).angle();
  return quality;
}

}  // namespace vantage
