#include "offboard/session/surface_cloud.h"

#include <cmath>

namespace vantage {
namespace {

constexpr int kNormalReach_px = 4;     // to the neighbours on each side: wide enough to rise above the depth's noise
constexpr float kSameSurface = 0.06F;  // neighbours whose depth differs by a larger share lie on another surface

/// Camera coordinates of a pixel at its depth.
Eigen::Vector3d point_at(const DepthMap& map, int u, int v) {
  const CameraModel& camera = map.camera;
  const auto i = static_cast<std::size_t>(v) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(u);
  const double z = static_cast<double>(map.depth_m[i]);
  return {(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z};
}

/// True when the pixel is measured, on the surface that lies at `z`.
bool on_surface(const DepthMap& map, int u, int v, float z) {
  if (u < 0 || v < 0 || u >= map.camera.width || v >= map.camera.height) return false;
  const auto i = static_cast<std::size_t>(v) * static_cast<std::size_t>(map.camera.width) + static_cast<std::size_t>(u);
  return map.state[i] == DepthState::kConverged && std::abs(map.depth_m[i] - z) < kSameSurface * z;
}

/// Normal at a measured pixel, camera frame.
Eigen::Vector3d normal_at(const DepthMap& map, int u, int v) {
  const Eigen::Vector3d point = point_at(map, u, v);
  const auto z = static_cast<float>(point.z());
  const auto difference = [&](int du, int dv) -> Eigen::Vector3d {
    const bool ahead = on_surface(map, u + du, v + dv, z), behind = on_surface(map, u - du, v - dv, z);
    if (!ahead && !behind) return Eigen::Vector3d::Zero();
    const Eigen::Vector3d a = ahead ? point_at(map, u + du, v + dv) : point;
    const Eigen::Vector3d b = behind ? point_at(map, u - du, v - dv) : point;
    return a - b;
  };
  const Eigen::Vector3d normal = difference(0, kNormalReach_px).cross(difference(kNormalReach_px, 0));
  if (normal.isZero(0)) return -point.normalized();
  return (normal.dot(point) > 0 ? -normal : normal).normalized();
}

}  // namespace

SurfaceCloud::SurfaceCloud(const Region& region, const SurfaceCloudOptions& options)
    : region_(region), options_(options) {}

void SurfaceCloud::clear() {
  cells_.clear();
  points_.clear();
  normals_.clear();
}

std::vector<Eigen::Vector3f> SurfaceCloud::add(const DepthMap& map) {
  std::vector<Eigen::Vector3f> added;
  const CameraModel& camera = map.camera;
  const Eigen::Vector3d extent = region_.max_corner() - region_.min_corner;
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const auto i = static_cast<std::size_t>(v) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(u);
      if (map.state[i] != DepthState::kConverged) continue;
      const double z = static_cast<double>(map.depth_m[i]);
      if (static_cast<double>(map.sigma_m[i]) > options_.largest_sigma_m || z > options_.max_range_m) continue;
      const Eigen::Vector3d point = map.T_world_camera * point_at(map, u, v);
      const Eigen::Vector3d offset = point - region_.min_corner;
      if ((offset.array() < 0).any() || (offset.array() >= extent.array()).any()) continue;
      const Eigen::Matrix<std::int64_t, 3, 1> cell = (offset / options_.spacing_m).array().floor().cast<std::int64_t>();
      constexpr int kBits = 21;
      if (!cells_.insert(cell.x() << 2 * kBits | cell.y() << kBits | cell.z()).second) continue;
      added.push_back(point.cast<float>());
      normals_.push_back((map.T_world_camera.linear() * normal_at(map, u, v)).cast<float>());
    }
  }
  points_.insert(points_.end(), added.begin(), added.end());
  return added;
}

}  // namespace vantage
