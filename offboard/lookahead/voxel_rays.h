#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/camera_model.h"

namespace vantage {

/// Columns and rows of a RayBundle whose rays are about a voxel apart at that distance (in voxels).
inline std::pair<int, int> rays_a_voxel_apart(const CameraModel& camera, double distance) {
  constexpr double kMostRays = 512;
  const auto count = [&](int pixels, double focal_px) {
    return static_cast<int>(std::clamp(std::ceil(pixels * std::max(1.0, distance) / focal_px), 1.0, kMostRays));
  };
  return {count(camera.width, camera.fx), count(camera.height, camera.fy)};
}

}  // namespace vantage
