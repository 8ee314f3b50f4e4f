#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "drivers/sim/mesh.h"

namespace vantage::sim {

/// A square room around the origin: ground at z = 0, four walls, no ceiling.
struct Room {
  double half_width_m = 2.0;  ///< the walls stand at x, y = +- this
  double height_m = 2.5;
};

/// One lamp, and light from all sides that is stronger from above. Radiance 1 is a white (255) pixel at the reference
/// exposure.
struct Light {
  Eigen::Vector3d position{1.1, -0.9, 2.4};
  double lamp = 0.75;         ///< radiance of a white surface that faces the lamp, without fall-off
  double ambient_up = 0.40;   ///< radiance of a white surface that faces up
  double ambient_down = 0.2;  ///< of one that faces down
};

/// All there is to see: a textured room with one textured object. The object alone casts a shadow.
struct World {
  Mesh object;
  Room room;
  Light light;
  std::uint32_t texture_seed = 1;
};

/// What a point belongs to.
enum class Surface { kNone, kGround, kWall, kObject };

/// Number of the pattern on a surface: each has another, so that no two join seamlessly where they touch.
std::uint32_t texture_seed(const World& world, Surface surface);

/// Ground and walls: two and eight triangles, the ground first.
Mesh room_mesh(const Room& room);
inline constexpr std::uint32_t kGroundTriangles = 2;

}  // namespace vantage::sim
