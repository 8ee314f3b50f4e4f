#include "drivers/sim/surface_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

#include "calib/files/input_error.h"
#include "drivers/sim/embree_scene.h"

namespace vantage::sim {
namespace {

/// Rays start this far off the surface, relative to the object's size: above float's rounding, below any detail.
constexpr float kRelativeOffset = 1e-4F;

/// Directions spread evenly over the sphere, each at the same share of its height (Fibonacci lattice). Neighbours in
/// the list point far apart, so that a free point is found to be free within a few.
std::vector<Eigen::Vector3f> sphere_of_directions() {
  const double golden_angle = std::numbers::pi * (3 - std::sqrt(5.0));
  std::vector<Eigen::Vector3f> directions;
  for (int i = 0; i < kEscapeDirections; ++i) {
    const int k = i * 89 % kEscapeDirections;  // 89 has no divisor in common with 256
    const double z = 1 - (2 * k + 1.0) / kEscapeDirections, r = std::sqrt(1 - z * z), angle = golden_angle * k;
    directions.push_back(Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z).cast<float>());
  }
  return directions;
}

bool blocked(RTCScene scene, const Eigen::Vector3f& from, const Eigen::Vector3f& direction) {
  RTCRay ray{};
  ray.org_x = from.x();
  ray.org_y = from.y();
  ray.org_z = from.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tfar = std::numeric_limits<float>::infinity();
  ray.mask = ~0U;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &ray);
  return ray.tfar < 0;
}

/// Uniform in [0, 1); the same on every machine, as std::uniform_real_distribution need not be.
double uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

}  // namespace

std::vector<Eigen::Vector3f> sample_surface(const Mesh& mesh, std::size_t count, std::uint64_t seed) {
  std::vector<double> area_up_to;
  double area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f ab = mesh.points[b] - mesh.points[a], ac = mesh.points[c] - mesh.points[a];
    area += 0.5 * static_cast<double>(ab.cross(ac).norm());
    area_up_to.push_back(area);
  }
  if (!(area > 0)) throw InputError("the mesh has no area: all its triangles are degenerate");

  EmbreeScene scene;
  scene.add(mesh);
  scene.commit();
  const std::vector<Eigen::Vector3f> directions = sphere_of_directions();
  const float offset = kRelativeOffset * (mesh.highest() - mesh.lowest()).maxCoeff();
  const auto escapes = [&](const Eigen::Vector3f& from, const Eigen::Vector3f& side) {
    return std::any_of(directions.begin(), directions.end(), [&](const Eigen::Vector3f& direction) {
      return direction.dot(side) > 0 && !blocked(scene.scene(), from, direction);
    });
  };

  std::mt19937_64 random(seed);
  std::vector<Eigen::Vector3f> samples;
  for (std::size_t tried = 0; samples.size() < count; ++tried) {
    if (tried > 1000 * (samples.size() + 1)) throw InputError("the mesh has no outer surface to speak of");
    const auto chosen = std::upper_bound(area_up_to.begin(), area_up_to.end(), uniform(random) * area);
    const auto& [a, b, c] =
        mesh.triangles[static_cast<std::size_t>(std::min(chosen, area_up_to.end() - 1) - area_up_to.begin())];
    // Uniform on a triangle (Osada et al., "Shape distributions", 2002).
    const auto root = static_cast<float>(std::sqrt(uniform(random))), along = static_cast<float>(uniform(random));
    const Eigen::Vector3f ab = mesh.points[b] - mesh.points[a], bc = mesh.points[c] - mesh.points[b];
    const Eigen::Vector3f point = mesh.points[a] + root * (ab + along * bc);
    const Eigen::Vector3f normal = ab.cross(bc).normalized();
    if (escapes(point + offset * normal, normal) || escapes(point - offset * normal, -normal)) {
      samples.push_back(point);
    }
  }
  return samples;
}

}  // namespace vantage::sim
