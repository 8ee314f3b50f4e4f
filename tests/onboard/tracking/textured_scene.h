#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "drivers/camera/frame_source.h"

namespace vantage::tracking {

inline CameraModel quarter_camera() {
  return {.width = 320, .height = 240, .fx = 250, .fy = 250, .cx = 159.5, .cy = 119.5};
}

/// Smooth noise on a lattice of cells of 1: in [0, 1], the same on every machine.
inline double lattice_noise(double x, double y, std::uint32_t seed) {
  const auto value = [seed](std::int64_t i, std::int64_t j) {
    std::uint64_t h = static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15ULL ^
                      static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4FULL ^ seed * 0x165667B19E3779F9ULL;
    h ^= h >> 31;
    h *= 0xBF58476D1CE4E5B9ULL;
    h ^= h >> 29;
    return static_cast<double>(h >> 11) / 9007199254740992.0;
  };
  const double fx = std::floor(x), fy = std::floor(y);
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double u = smooth(x - fx), v = smooth(y - fy);
  const auto i = static_cast<std::int64_t>(fx), j = static_cast<std::int64_t>(fy);
  return (1 - v) * ((1 - u) * value(i, j) + u * value(i + 1, j)) +
         v * ((1 - u) * value(i, j + 1) + u * value(i + 1, j + 1));
}

/// A corner of a room: floor, a wall ahead and one to the left, all textured. World: z up; the camera looks along +x.
/// Pixels and depths follow from rays and planes alone.
class TexturedScene {
 public:
  /// Grey value and distance of what a ray (unit) from `eye` hits.
  static double shade(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double* distance) {
    struct Plane {
      Eigen::Vector3d normal;
      double offset;
      int u, v;
      std::uint32_t seed;
    };
    static const Plane kPlanes[] = {{{0, 0, 1}, 0.0, 0, 1, 1}, {{1, 0, 0}, 2.0, 1, 2, 2}, {{0, 1, 0}, 1.2, 0, 2, 3}};
    double nearest = 1e9;
    const Plane* hit = nullptr;
    for (const Plane& plane : kPlanes) {
      const double slope = plane.normal.dot(ray);
      if (std::abs(slope) < 1e-9) continue;
      const double s = (plane.offset - plane.normal.dot(eye)) / slope;
      if (s > 1e-6 && s < nearest) {
        nearest = s;
        hit = &plane;
      }
    }
    if (distance != nullptr) *distance = nearest;
    if (hit == nullptr) return 0;
    const Eigen::Vector3d p = eye + nearest * ray;
    // Cells of 50, 16, 6 and 3 cm: at 1.5 m and f = 250 px some 83, 27, 10 and 5 px.
    const double a = p[hit->u], b = p[hit->v];
    return 20 + 210 * (0.3 * lattice_noise(a / 0.5, b / 0.5, hit->seed + 30) +
                       0.2 * lattice_noise(a / 0.16, b / 0.16, hit->seed) +
                       0.3 * lattice_noise(a / 0.06, b / 0.06, hit->seed + 10) +
                       0.2 * lattice_noise(a / 0.03, b / 0.03, hit->seed + 20));
  }

  /// What a camera sees, with Gaussian noise, as a frame. `light` multiplies everything.
  static Frame render(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera, std::uint64_t sequence,
                      double noise_sigma = 1, double light = 1) {
    auto pixels = std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(camera.width * camera.height));
    std::mt19937 random(static_cast<std::uint32_t>(sequence + 1));
    std::normal_distribution<double> normal(0, 1);
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        Eigen::Vector3d ray;
        camera.unproject({u, v}, &ray);
        double grey = light * shade(T_world_camera.translation(), T_world_camera.linear() * ray, nullptr);
        if (noise_sigma > 0) grey += noise_sigma * normal(random);
        (*pixels)[static_cast<std::size_t>(v * camera.width + u)] =
            static_cast<std::uint8_t>(std::min(255.0, std::max(0.0, std::round(grey))));
      }
    }
    return as_frame(camera, pixels, sequence);
  }

  static Frame covered(const CameraModel& camera, std::uint64_t sequence) {
    return as_frame(camera,
                    std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(camera.width * camera.height)),
                    sequence);
  }

  /// Looks along +x and a little down from `position`, turned by `yaw_rad` about the vertical.
  static Eigen::Isometry3d pose(const Eigen::Vector3d& position, double yaw_rad = 0, double pitch_rad = 0.35) {
    Eigen::Matrix3d axes;  // camera x, y, z in a world that it looks at along +x
    axes.col(0) = Eigen::Vector3d(0, -1, 0);
    axes.col(1) = Eigen::Vector3d(0, 0, -1);
    axes.col(2) = Eigen::Vector3d(1, 0, 0);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix() *
                 Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()).toRotationMatrix() * axes;
    T.translation() = position;
    return T;
  }

  /// A hand's sway: at `t_s` seconds.
  static Eigen::Isometry3d sway(double t_s) {
    return pose({0.2 + 0.08 * std::sin(1.1 * t_s), -0.3 + 0.25 * std::sin(0.8 * t_s), 0.9 + 0.06 * std::sin(1.7 * t_s)},
                0.08 * std::sin(0.6 * t_s));
  }

 private:
  static Frame as_frame(const CameraModel& camera, const std::shared_ptr<std::vector<std::uint8_t>>& pixels,
                        std::uint64_t sequence) {
    Frame frame;
    frame.sequence = sequence;
    frame.capture_time_ns = static_cast<std::int64_t>(sequence) * 33'333'333;
    frame.image.width = camera.width;
    frame.image.height = camera.height;
    frame.image.stride = camera.width;
    frame.image.pixels = {pixels, pixels->data()};
    return frame;
  }
};

}  // namespace vantage::tracking
