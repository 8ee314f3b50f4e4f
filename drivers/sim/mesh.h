#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vantage::sim {

/// Triangles in the world frame, metres. They need be neither closed nor oriented alike.
struct Mesh {
  std::vector<Eigen::Vector3f> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< indices into `points`

  /// Lowest and highest corner of the axis-aligned box around all points; both zero for an empty mesh.
  Eigen::Vector3f lowest() const;
  Eigen::Vector3f highest() const;
};

/// Which axis of a mesh file points up.
enum class UpAxis { kY, kZ };

/// What `load_mesh` assumes where nobody says: glTF demands y up and OBJ has it by custom (y: .glb .gltf .obj); every
/// other format is taken as z up.
UpAxis default_up(const std::filesystem::path& path);

/// The smallest and the largest object that the simulated room and cameras are made for.
inline constexpr double kSmallestObject_m = 0.01;
inline constexpr double kLargestObject_m = 2.0;

struct MeshOptions {
  double size_m = 0.30;      ///< largest side of the bounding box after scaling
  std::optional<UpAxis> up;  ///< default_up() of the file when empty
};

/// Reads an object (PLY of triangles, OBJ, GLB, STL, OFF, and whatever else assimp reads), turns it z up, scales it,
/// and sets it on the ground: lowest point at z = 0, centre of the bounding box at x = y = 0.
///
/// \throws InputError that names the file: missing, unreadable, cut short, without triangles, with a vertex that is not
/// finite, without extent; or a size outside [kSmallestObject_m, kLargestObject_m].
Mesh load_mesh(const std::filesystem::path& path, const MeshOptions& options = {});

}  // namespace vantage::sim
