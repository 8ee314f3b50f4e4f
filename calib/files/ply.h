#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

namespace vantage {

/// Points, or a triangle mesh over them, as a PLY file holds them. World frame, metres.
struct PlyModel {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> normals;                 ///< empty, or one a point
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< empty for a cloud; indices into `points`
};

/// Writes binary little-endian PLY, whole or not at all.
/// \throws InputError when the file can't be written; std::invalid_argument when the sizes contradict each other.
void write_ply(const std::filesystem::path& path, const PlyModel& model);

/// Reads what write_ply writes, and any other ASCII or binary little-endian PLY whose vertices have x, y, z (float or
/// double) and whose faces, if any, are triangles. Other properties are passed over.
/// \throws InputError that names the file and the fault.
PlyModel read_ply(const std::filesystem::path& path);

}  // namespace vantage
