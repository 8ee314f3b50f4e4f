#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "onboard/depth/depth_filter.h"

namespace vantage {

/// Textured rectangles that face -z: a scene whose depth and whose images can be calculated.
struct PlaneScene {
  struct Rectangle {
    double z = 1;  ///< m
    Eigen::Vector2d centre = {0, 0}, half = {1e9, 1e9};
    double grain_m = 0.02;  ///< size of the texture's spots
    double contrast = 100;  ///< grey levels between its darkest and its brightest
    double slope = 0;       ///< d z / d x
    std::uint32_t seed = 1;
  };
  std::vector<Rectangle> rectangles;

  /// Depth along z and grey of one ray from `eye`; none where there is nothing.
  struct Hit {
    double distance = std::numeric_limits<double>::infinity();  ///< along the ray whose z component in the camera is 1
    double grey = 0;
  };
  Hit look(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) const {
    Hit nearest;
    for (const Rectangle& r : rectangles) {
      // eye.z + t ray.z = z + slope (eye.x + t ray.x - centre.x)
      const double along = ray.z() - r.slope * ray.x();
      const double t = (r.z + r.slope * (eye.x() - r.centre.x()) - eye.z()) / along;
      if (!(t > 0) || t >= nearest.distance) continue;
      const Eigen::Vector2d place = (eye + t * ray).head<2>() - r.centre;
      if (std::abs(place.x()) > r.half.x() || std::abs(place.y()) > r.half.y()) continue;
      nearest = {t, 128 + r.contrast * (texture(place / r.grain_m, r.seed) - 0.5)};
    }
    return nearest;
  }

  /// Value noise: smooth between hashed values at whole numbers; two octaves; from 0 to 1.
  static double texture(const Eigen::Vector2d& place, std::uint32_t seed) {
    return (2 * value_noise(place, seed) + value_noise(2.17 * place, seed + 77)) / 3;
  }

 private:
  static double hashed(std::int64_t x, std::int64_t y, std::uint32_t seed) {
    std::uint64_t h = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15ULL ^
                      static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4FULL ^ (static_cast<std::uint64_t>(seed) << 32);
    h = (h ^ (h >> 30)) * 0xBF58476D1CE4E5B9ULL;
    h = (h ^ (h >> 27)) * 0x94D049BB133111EBULL;
    return static_cast<double>((h ^ (h >> 31)) >> 11) / 9007199254740992.0;
  }
  static double value_noise(const Eigen::Vector2d& place, std::uint32_t seed) {
    const double x0 = std::floor(place.x()), y0 = std::floor(place.y());
    const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
    const double fx = smooth(place.x() - x0), fy = smooth(place.y() - y0);
    const auto x = static_cast<std::int64_t>(x0), y = static_cast<std::int64_t>(y0);
    const double top = (1 - fx) * hashed(x, y, seed) + fx * hashed(x + 1, y, seed);
    const double bottom = (1 - fx) * hashed(x, y + 1, seed) + fx * hashed(x + 1, y + 1, seed);
    return (1 - fy) * top + fy * bottom;
  }
};

/// A small camera: tests take milliseconds.
inline CameraModel small_camera() {
  return {.width = 160, .height = 120, .fx = 150, .fy = 150, .cx = 79.5, .cy = 59.5, .coefficients = {}};
}

/// What the camera sees from a pose: four samples a pixel, noise of `noise` grey levels, times `gain` plus `offset`.
inline GreyImage photograph(const PlaneScene& scene, const CameraModel& camera, const Eigen::Isometry3d& T_world_camera,
                            std::uint64_t seed, double noise = 1, double gain = 1, double offset = 0) {
  auto pixels = std::make_shared<std::vector<std::uint8_t>>();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, 1);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      double grey = 0;
      for (int s = 0; s < 4; ++s) {
        const double u = x + (s % 2 == 0 ? -0.25 : 0.25), v = y + (s / 2 == 0 ? -0.25 : 0.25);
        const Eigen::Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
        grey += 0.25 * scene.look(T_world_camera.translation(), T_world_camera.linear() * ray).grey;
      }
      pixels->push_back(
          static_cast<std::uint8_t>(std::clamp(std::lround(gain * grey + offset + noise * normal(random)), 0L, 255L)));
    }
  }
  return {.width = camera.width,
          .height = camera.height,
          .stride = camera.width,
          .pixels = std::shared_ptr<const std::uint8_t>(pixels, pixels->data())};
}

/// True depth along z of every pixel.
inline std::vector<float> true_depth(const PlaneScene& scene, const CameraModel& camera,
                                     const Eigen::Isometry3d& T_world_camera) {
  std::vector<float> depth_m;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
      depth_m.push_back(
          static_cast<float>(scene.look(T_world_camera.translation(), T_world_camera.linear() * ray).distance));
    }
  }
  return depth_m;
}

/// The camera at a place, turned about its y axis.
inline Eigen::Isometry3d camera_at(double x, double y, double z, double turn_rad = 0) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(x, y, z);
  pose.linear() = Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return pose;
}

inline PosedImage posed(std::int64_t number, GreyImage image, const Eigen::Isometry3d& T_world_camera) {
  PosedImage frame;
  frame.capture_time_ns = 1'000'000'000 + number * 33'000'000;
  frame.image = std::move(image);
  frame.T_world_camera = T_world_camera;
  return frame;
}

}  // namespace vantage
