#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "calib/look_at.h"
#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// A sphere and a box on a square ground within four walls, whose depth every pixel can be told exactly.
struct AnalyticScene {
  Eigen::Vector3d sphere_center{-0.12, 0.03, 0.18};
  double sphere_radius = 0.14;
  Eigen::Vector3d box_min{0.1, -0.12, 0.0}, box_max{0.26, 0.1, 0.22};
  double ground_z = 0;
  double half_width = 1.5;  ///< of the room: ground and walls

  /// Distance along the ray, in lengths of `direction`, to the first surface; infinity: none.
  double first_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
    double first = std::numeric_limits<double>::infinity();
    if (direction.z() < 0) first = (ground_z - origin.z()) / direction.z();
    for (int axis = 0; axis < 2; ++axis) {
      if (direction[axis] == 0) continue;
      first = std::min(first, ((direction[axis] > 0 ? half_width : -half_width) - origin[axis]) / direction[axis]);
    }
    const Eigen::Vector3d to_center = origin - sphere_center;
    const double a = direction.squaredNorm(), b = direction.dot(to_center);
    const double discriminant = b * b - a * (to_center.squaredNorm() - sphere_radius * sphere_radius);
    if (discriminant > 0) {
      const double t = (-b - std::sqrt(discriminant)) / a;
      if (t > 0) first = std::min(first, t);
    }
    const Eigen::Array3d low = (box_min - origin).array() / direction.array();
    const Eigen::Array3d high = (box_max - origin).array() / direction.array();
    const double enter = low.min(high).maxCoeff(), leave = low.max(high).minCoeff();
    if (enter > 0 && enter < leave) first = std::min(first, enter);
    return first;
  }

  /// Unsigned distance from a point within the room to the nearest surface of sphere, box or ground.
  double distance(const Eigen::Vector3d& point) const {
    const double sphere = std::abs((point - sphere_center).norm() - sphere_radius);
    const Eigen::Array3d q = (point - 0.5 * (box_min + box_max)).array().abs() - 0.5 * (box_max - box_min).array();
    const double box = std::abs(q.max(0).matrix().norm() + std::min(q.maxCoeff(), 0.0));
    return std::min({sphere, box, std::abs(point.z() - ground_z)});
  }

  /// Depth image from `pose`. Noise: normal, of standard deviation `sigma_m`, which every pixel also states (at least
  /// 0.1 mm). Pixels beside a depth edge of more than 3 cm are kEdge.
  DepthMap depth_map(const CameraModel& camera, const Eigen::Isometry3d& pose, double sigma_m = 0,
                     unsigned seed = 1) const {
    DepthMap map;
    map.camera = camera;
    map.T_world_camera = pose;
    const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
    map.depth_m.assign(pixels, 0);
    map.sigma_m.assign(pixels, static_cast<float>(std::max(sigma_m, 1e-4)));
    map.state.assign(pixels, DepthState::kInvalid);
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 1);
    std::size_t i = 0;
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u, ++i) {
        const Eigen::Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
        const double depth = first_hit(pose.translation(), pose.linear() * ray);
        if (!std::isfinite(depth)) continue;
        map.depth_m[i] = static_cast<float>(std::max(0.01, depth + (sigma_m > 0 ? sigma_m * noise(random) : 0)));
        map.state[i] = DepthState::kConverged;
      }
    }
    const std::vector<float> depth = map.depth_m;
    const auto width = static_cast<std::size_t>(camera.width);
    for (i = 0; i < pixels; ++i) {
      const std::size_t u = i % width;
      for (const std::size_t j : {u > 0 ? i - 1 : i, u + 1 < width ? i + 1 : i, i >= width ? i - width : i,
                                  i + width < pixels ? i + width : i}) {
        if (map.state[i] == DepthState::kConverged && std::abs(depth[i] - depth[j]) > 0.03F) {
          map.state[i] = DepthState::kEdge;
        }
      }
    }
    return map;
  }
};

/// The experiment's camera at VGA size.
inline CameraModel vga_camera() { return {640, 480, 448, 448, 319.5, 239.5, Distortion::kNone, {}}; }

/// The 48 views of the simulated experiment: 16 azimuths at z = 0.15, z = 0.35, and 45 degrees up, radius 0.6 m.
inline std::vector<Eigen::Isometry3d> ring_views(double radius = 0.6) {
  std::vector<Eigen::Isometry3d> views;
  const Eigen::Vector3d target(0.03, 0, 0.12);
  for (int ring = 0; ring < 3; ++ring) {
    for (int i = 0; i < 16; ++i) {
      const double azimuth = 2 * std::numbers::pi * i / 16, slant = std::numbers::sqrt2 / 2;
      const double r = ring < 2 ? radius : radius * slant;
      const double z = ring == 0 ? 0.15 : ring == 1 ? 0.35 : 0.35 + radius * slant;
      views.push_back(look_at({r * std::cos(azimuth), r * std::sin(azimuth), z}, target));
    }
  }
  return views;
}

}  // namespace vantage
