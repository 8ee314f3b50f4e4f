#include "offboard/session/surface_cloud.h"

#include <cmath>

namespace vantage {

SurfaceCloud::SurfaceCloud(const Region& region, const SurfaceCloudOptions& options)
    : region_(region), options_(options) {}

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
      const Eigen::Vector3d point =
          map.T_world_camera * Eigen::Vector3d((u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z);
      const Eigen::Vector3d offset = point - region_.min_corner;
      if ((offset.array() < 0).any() || (offset.array() >= extent.array()).any()) continue;
      const Eigen::Matrix<std::int64_t, 3, 1> cell = (offset / options_.spacing_m).array().floor().cast<std::int64_t>();
      constexpr int kBits = 21;
      if (!cells_.insert(cell.x() << 2 * kBits | cell.y() << kBits | cell.z()).second) continue;
      added.push_back(point.cast<float>());
    }
  }
  points_.insert(points_.end(), added.begin(), added.end());
  return added;
}

}  // namespace vantage
