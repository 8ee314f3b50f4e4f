#include "drivers/sim/world.h"

namespace vantage::sim {

std::uint32_t texture_seed(const World& world, Surface surface) {
  return world.texture_seed * 4 + static_cast<std::uint32_t>(surface);
}

Mesh room_mesh(const Room& room) {
  const auto w = static_cast<float>(room.half_width_m), h = static_cast<float>(room.height_m);
  Mesh mesh;
  mesh.points = {{-w, -w, 0}, {w, -w, 0}, {w, w, 0}, {-w, w, 0}, {-w, -w, h}, {w, -w, h}, {w, w, h}, {-w, w, h}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  for (std::uint32_t side = 0; side < 4; ++side) {
    const std::uint32_t next = (side + 1) % 4;
    mesh.triangles.push_back({side, next, next + 4});
    mesh.triangles.push_back({side, next + 4, side + 4});
  }
  return mesh;
}

}  // namespace vantage::sim
