#include "drivers/sim/renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "box.h"
#include "calib/look_at.h"

namespace vantage::sim {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const Box kBox{{-0.15, -0.1, 0}, {0.15, 0.1, 0.2}};
const CameraModel kCamera{188, 120, 112, 112, 93.5, 59.5, Distortion::kNone, {}};

World world_with_box() {
  World world;
  world.object = kBox.mesh();
  return world;
}

/// Nearest of ground, walls and box along a ray from inside the room.
double analytic_hit(const Room& room, const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  double nearest = kBox.hit(from, direction);
  const double w = room.half_width_m;
  const auto plane = [&](int axis, double at) {
    const double t = (at - from[axis]) / direction[axis];
    const Eigen::Vector3d p = from + t * direction;
    const bool inside = axis == 2 ? std::abs(p.x()) <= w && std::abs(p.y()) <= w
                                  : std::abs(p[1 - axis]) <= w && p.z() >= 0 && p.z() <= room.height_m;
    if (t > 0 && inside) nearest = std::min(nearest, t);
  };
  plane(2, 0);
  for (const int axis : {0, 1}) {
    plane(axis, w);
    plane(axis, -w);
  }
  return nearest;
}

void expect_analytic_depth(const CameraModel& camera, const Eigen::Isometry3d& pose) {
  const World world = world_with_box();
  std::vector<float> depth_m;
  Renderer(world).depth(camera, pose, &depth_m);
  ASSERT_EQ(depth_m.size(), static_cast<std::size_t>(camera.width * camera.height));
  int on_box = 0, differ = 0;
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      Eigen::Vector3d ray;
      ASSERT_TRUE(camera.unproject({u, v}, &ray));
      const Eigen::Vector3d direction = pose.linear() * (ray / ray.z());
      const double expected = analytic_hit(world.room, pose.translation(), direction);
      const auto rendered = static_cast<double>(depth_m[static_cast<std::size_t>(v * camera.width + u)]);
      on_box += expected == kBox.hit(pose.translation(), direction) && std::isfinite(expected);
      if (std::isinf(expected) ? !std::isinf(rendered) : !(std::abs(rendered - expected) < 3e-6 * expected)) ++differ;
    }
  }
  // A ray that grazes an edge may fall to either side by float's rounding.
  EXPECT_LE(differ, 2);
  EXPECT_GT(on_box, 500);
}

TEST(Renderer, DepthIsThatOfTheNearestPlane) {
  expect_analytic_depth(kCamera, look_at({0.6, 0, 0.35}, {0, 0, 0.1}));
  expect_analytic_depth(kCamera, look_at({-0.31, 0.42, 0.15}, {0.02, 0.01, 0.1}));
  expect_analytic_depth(kCamera, look_at({0.1, -0.7, 0.05}, {0, 0, 0.4}));
  expect_analytic_depth(kCamera, look_at({0.01, 0.02, 0.9}, {0, 0, 0.1}));
}

TEST(Renderer, DepthFollowsALensesDistortion) {
  CameraModel camera = kCamera;
  camera.distortion = Distortion::kRadTan;
  camera.coefficients = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0};
  expect_analytic_depth(camera, look_at({0.6, 0, 0.35}, {0, 0, 0.1}));
}

TEST(Renderer, ThereIsNothingAboveTheWalls) {
  std::vector<float> depth_m, radiance;
  const Renderer renderer(world_with_box());
  renderer.depth(kCamera, look_at({0, 0, 1}, {0.5, 0, 3}), &depth_m);
  renderer.render(kCamera, look_at({0, 0, 1}, {0.5, 0, 3}), &radiance);
  EXPECT_TRUE(std::isinf(depth_m.front()));
  EXPECT_EQ(radiance.front(), 0);
}

TEST(Renderer, NeitherThreadsNorRepetitionChangeABit) {
  const Eigen::Isometry3d pose = look_at({0.4, 0.4, 0.35}, {0, 0, 0.1});
  const World world = world_with_box();
  std::vector<float> first_radiance, first_depth;
  Renderer(world, 1).render(kCamera, pose, &first_radiance);
  Renderer(world, 1).depth(kCamera, pose, &first_depth);
  for (const int threads : {1, 2, 3, 7}) {
    const Renderer renderer(world, threads);
    for (int repetition = 0; repetition < 3; ++repetition) {
      std::vector<float> radiance, depth_m;
      renderer.render(kCamera, pose, &radiance);
      renderer.depth(kCamera, pose, &depth_m);
      EXPECT_EQ(radiance, first_radiance) << threads;
      EXPECT_EQ(depth_m, first_depth) << threads;
    }
  }
}

/// Where a pixel's corner looks at on the ground.
Eigen::Vector3d ground_point(const Eigen::Isometry3d& pose, double u, double v) {
  const Eigen::Vector3d ray((u - kCamera.cx) / kCamera.fx, (v - kCamera.cy) / kCamera.fy, 1);
  const Eigen::Vector3d direction = pose.linear() * ray;
  return pose.translation() - pose.translation().z() / direction.z() * direction;
}

TEST(Renderer, TheObjectTakesTheLampsLightFromTheGroundBehindIt) {
  World world = world_with_box(), empty;
  const Eigen::Isometry3d pose = look_at({-0.5, 0.5, 0.6}, {-0.1, 0.1, 0});
  std::vector<float> with_box, without_box, depth_m, empty_depth;
  const Renderer full(world), bare(empty);
  full.render(kCamera, pose, &with_box);
  bare.render(kCamera, pose, &without_box);
  full.depth(kCamera, pose, &depth_m);
  bare.depth(kCamera, pose, &empty_depth);

  int shaded = 0, lit = 0;
  for (int v = 1; v + 1 < kCamera.height; ++v) {
    for (int u = 1; u + 1 < kCamera.width; ++u) {
      const auto i = static_cast<std::size_t>(v * kCamera.width + u);
      // Only ground, in this pixel and around it.
      bool ground = true, all = true, none = true;
      for (const int dv : {-1, 0, 1}) {
        for (const int du : {-1, 0, 1}) {
          const auto k = static_cast<std::size_t>((v + dv) * kCamera.width + u + du);
          ground = ground && depth_m[k] == empty_depth[k];
          const Eigen::Vector3d p = ground_point(pose, u + du, v + dv);
          ground = ground && std::abs(p.x()) < 1.9 && std::abs(p.y()) < 1.9 && (p - pose.translation()).norm() < 5;
          const bool dark = std::isfinite(kBox.hit(p, world.light.position - p));
          all = all && dark;
          none = none && !dark;
        }
      }
      if (!ground) continue;
      const double ratio = static_cast<double>(with_box[i]) / static_cast<double>(without_box[i]);
      if (all) {
        // What is left is the ambient light; the lamp's share is Lambert's cosine.
        const Eigen::Vector3d to_lamp = world.light.position - ground_point(pose, u, v);
        const double lamp = world.light.lamp * to_lamp.z() / to_lamp.norm();
        EXPECT_NEAR(ratio, world.light.ambient_up / (world.light.ambient_up + lamp), 1e-3) << u << " " << v;
        ++shaded;
      } else if (none) {
        EXPECT_NEAR(ratio, 1, 1e-5) << u << " " << v;
        ++lit;
      }
    }
  }
  EXPECT_GT(shaded, 300);
  EXPECT_GT(lit, 5000);
}

}  // namespace
}  // namespace vantage::sim
