#include "offboard/lookahead/map_window.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "offboard/gain/ray_bundle.h"
#include "offboard/lookahead/voxel_rays.h"
#include "offboard/mapping/ray_walk.h"

namespace vantage {
namespace {

constexpr int kMost = 127;

std::int8_t scaled(double share) { return static_cast<std::int8_t>(std::lround(std::clamp(share, -1.0, 1.0) * kMost)); }

std::size_t index_of(const Eigen::Vector3i& v) {
  return static_cast<std::size_t>(v.x() + MapWindow::kWidth * (v.y() + MapWindow::kWidth * v.z()));
}

}  // namespace

MapWindow::MapWindow(const OccupancyMap& map, const CameraModel& camera, std::span<const Eigen::Isometry3d> views,
                     const Eigen::Vector3d& foot)
    : numbers_(kVoxels) {
  const Region& region = map.region();
  const Eigen::Vector3d at = region.to_voxels(foot);
  min_ = {static_cast<int>(std::lround(at.x())) - kWidth / 2, static_cast<int>(std::lround(at.y())) - kWidth / 2,
          static_cast<int>(std::lround(at.z()))};
  const double d_max = map.sensor_model().occlusion_range_m;
  std::vector<std::uint8_t> solid(kVoxels);
  Eigen::Vector3i v;
  std::size_t i = 0;
  for (v.z() = 0; v.z() < kHeight; ++v.z()) {
    for (v.y() = 0; v.y() < kWidth; ++v.y()) {
      for (v.x() = 0; v.x() < kWidth; ++v.x(), ++i) {
        const Eigen::Vector3i voxel = min_ + v;
        if (!region.contains(voxel)) continue;
        Numbers& to = numbers_[i];
        const VoxelState state = map.state(voxel);
        solid[i] = state == VoxelState::kOccupied;
        to[kFree] = state == VoxelState::kFree ? kMost : 0;
        to[kOccupied] = solid[i] != 0 ? kMost : 0;
        to[kProbability] = scaled(map.probability(voxel));
        if (map.has_mark(voxel)) {
          to[kBehind] = std::max<std::int8_t>(1, scaled(1 - map.occlusion_distance_m(voxel) / d_max));
        }
        to[kAboveGround] = scaled(static_cast<double>(v.z()) / kHeight);
        to[kViews] = scaled(static_cast<double>(views.size()) / 16);
      }
    }
  }

  std::vector<Eigen::Vector3f> from(kVoxels, Eigen::Vector3f::Zero()), hidden(kVoxels, Eigen::Vector3f::Zero());
  std::vector<std::uint8_t> looked(kVoxels), seen(kVoxels);
  const Eigen::Vector3i size(kWidth, kWidth, kHeight);
  for (const Eigen::Isometry3d& view : views) {
    const Eigen::Vector3d camera_at = region.to_voxels(view.translation()) - min_.cast<double>();
    const auto [columns, rows] = rays_a_voxel_apart(camera, (camera_at - 0.5 * size.cast<double>()).norm());
    const RayBundle rays(camera, columns, rows);
    std::fill(seen.begin(), seen.end(), std::uint8_t{0});
    for (const Eigen::Vector3d& ray : rays.directions()) {
      walk_ray(camera_at, view.linear() * ray, size, [&](const Eigen::Vector3i& voxel, double, double) {
        const std::size_t n = index_of(voxel);
        seen[n] = 1;
        return solid[n] == 0;
      });
    }
    i = 0;
    for (v.z() = 0; v.z() < kHeight; ++v.z()) {
      for (v.y() = 0; v.y() < kWidth; ++v.y()) {
        for (v.x() = 0; v.x() < kWidth; ++v.x(), ++i) {
          const Eigen::Vector3f to_camera =
              (camera_at - v.cast<double>() - Eigen::Vector3d::Constant(0.5)).normalized().cast<float>();
          (seen[i] != 0 ? from : hidden)[i] += to_camera;
          looked[i] += seen[i];
        }
      }
    }
  }
  for (i = 0; i < kVoxels; ++i) {
    Numbers& to = numbers_[i];
    if (to[kViews] == 0) continue;  // outside the region
    to[kLookedAt] = scaled(looked[i] / 8.0);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<Eigen::Index>(k);
      to[kLookedFrom + k] = scaled(static_cast<double>(from[i][axis]) / std::max<int>(1, looked[i]));
      to[kHiddenFrom + k] = scaled(static_cast<double>(hidden[i][axis]) / static_cast<double>(views.size()));
    }
  }
}

Eigen::Vector3d focus_of(std::span<const CandidateView> views, const Eigen::Vector3d& otherwise) {
  constexpr double kLeastEigenvalue = 1e-3;  // of the mean projection: nearly parallel below
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const CandidateView& view : views) {
    const Eigen::Vector3d axis = view.T_world_camera.linear().col(2);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    sum += across;
    right += across * view.T_world_camera.translation();
  }
  if (views.empty()) return otherwise;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum / static_cast<double>(views.size()));
  if (solver.eigenvalues()[0] < kLeastEigenvalue) return otherwise;
  return sum.ldlt().solve(right);
}

}  // namespace vantage
