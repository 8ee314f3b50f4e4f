#include "drivers/sim/boxes_room.h"

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

namespace vantage::sim {
namespace {

/// Closed box on the ground, its base centred at (x, y), turned by `heading` about z.
void add_box(Mesh& mesh, const Eigen::Vector2d& centre, double heading, const Eigen::Vector3d& size) {
  const auto base = static_cast<std::uint32_t>(mesh.points.size());
  const Eigen::Rotation2Dd turn(heading);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector2d flat((corner & 1 ? 0.5 : -0.5) * size.x(), (corner & 2 ? 0.5 : -0.5) * size.y());
    const Eigen::Vector2d placed = centre + turn * flat;
    mesh.points.push_back(Eigen::Vector3d(placed.x(), placed.y(), corner & 4 ? size.z() : 0).cast<float>());
  }
  constexpr std::array<std::array<std::uint32_t, 3>, 12> kFaces = {{{0, 2, 1},
                                                                    {1, 2, 3},
                                                                    {4, 5, 6},
                                                                    {5, 7, 6},
                                                                    {0, 1, 4},
                                                                    {1, 5, 4},
                                                                    {2, 6, 3},
                                                                    {3, 6, 7},
                                                                    {0, 4, 2},
                                                                    {2, 4, 6},
                                                                    {1, 3, 5},
                                                                    {3, 7, 5}}};
  for (const auto& [i, j, k] : kFaces) mesh.triangles.push_back({base + i, base + j, base + k});
}

}  // namespace

World boxes_room(std::uint32_t seed) {
  constexpr int kBoxes = 12;
  // The generator's own bits, not a distribution's, so that every standard library builds the same room.
  std::mt19937 random(seed);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  World world;
  world.room = {.half_width_m = 1.8, .height_m = 2.5};
  world.texture_seed = seed;
  for (int i = 0; i < kBoxes; ++i) {
    // Spread over the disc by the golden angle: boxes stand apart without a search.
    const double radius = 0.85 * std::sqrt((i + 0.5) / kBoxes);
    const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0)) + uniform(-0.2, 0.2);
    const Eigen::Vector3d size(uniform(0.10, 0.30), uniform(0.10, 0.30), uniform(0.08, 0.45));
    add_box(world.object, radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)), uniform(0, std::numbers::pi),
            size);
  }
  return world;
}

}  // namespace vantage::sim
