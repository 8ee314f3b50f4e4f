// extract_mesh: marching cubes (Lorensen and Cline, 1987) with a case table that is worked out, not listed.

#include <cmath>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>

#include "offboard/mapping/tsdf.h"

namespace vantage {
namespace {

// Corner c of a cell lies at (c & 1, c >> 1 & 1, c >> 2). Edge 4 a + j runs along axis a from the j-th of the four
// corners whose bit a is clear.
constexpr std::array<std::array<int, 4>, 3> kEdgeStarts = {{{0, 2, 4, 6}, {0, 1, 4, 5}, {0, 1, 2, 3}}};

int edge_between(int corner_a, int corner_b) {
  const int low = std::min(corner_a, corner_b), bit = corner_a ^ corner_b;
  const int axis = bit == 1 ? 0 : bit == 2 ? 1 : 2;
  int j = 0;
  while (kEdgeStarts[static_cast<std::size_t>(axis)][static_cast<std::size_t>(j)] != low) ++j;
  return 4 * axis + j;
}

/// Triangles, as triples of edges, by which corners lie inside (distance below zero).
class CaseTable {
 public:
  CaseTable() {
    for (unsigned inside = 0; inside < 256; ++inside) cases_[inside] = triangles_of(inside);
  }
  const std::vector<std::array<int, 3>>& triangles(unsigned inside) const { return cases_[inside]; }

 private:
  /// On each face the surface's line cuts off each run of inside corners: it goes from the edge on which one enters the
  /// run to the edge on which one leaves it, walking round the face. A cell's edge belongs to two faces that walk it in
  /// opposite ways, so the lines join to closed loops; and as the rule asks for the face's corners alone, neighbouring
  /// cells agree on ambiguous faces, and the surface has no holes.
  static std::vector<std::array<int, 3>> triangles_of(unsigned inside) {
    std::array<int, 12> next;
    next.fill(-1);
    for (int axis = 0; axis < 3; ++axis) {
      const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3, base = 1 << axis;
      for (const int side : {0, 1}) {
        // Counter-clockwise seen from outside the cell.
        std::array<int, 4> ring = {0, u, u | v, v};
        if (side == 0) std::swap(ring[1], ring[3]);
        for (int& corner : ring) corner |= side * base;
        const auto is_inside = [&](int i) { return (inside >> ring[static_cast<std::size_t>(i & 3)] & 1) != 0; };
        for (int i = 0; i < 4; ++i) {
          if (is_inside(i) || !is_inside(i + 1)) continue;  // enters a run between i and i + 1
          int last = i + 1;
          while (is_inside(last + 1)) ++last;
          const int enter =
              edge_between(ring[static_cast<std::size_t>(i)], ring[static_cast<std::size_t>((i + 1) & 3)]);
          const int leave =
              edge_between(ring[static_cast<std::size_t>(last & 3)], ring[static_cast<std::size_t>((last + 1) & 3)]);
          next[static_cast<std::size_t>(enter)] = leave;
        }
      }
    }
    std::vector<std::array<int, 3>> triangles;
    for (int first = 0; first < 12; ++first) {
      if (next[static_cast<std::size_t>(first)] < 0) continue;
      int second = std::exchange(next[static_cast<std::size_t>(first)], -1);
      for (int third = next[static_cast<std::size_t>(second)]; third != first;
           third = next[static_cast<std::size_t>(second)]) {
        triangles.push_back({first, second, third});
        next[static_cast<std::size_t>(second)] = -1;
        second = third;
      }
      next[static_cast<std::size_t>(second)] = -1;
    }
    return triangles;
  }

  std::array<std::vector<std::array<int, 3>>, 256> cases_;
};

/// Values of a brick's voxels and of the layer beyond its far faces.
class Block {
 public:
  static constexpr int kEdge = 9;

  Block(const Tsdf& tsdf, const Eigen::Vector3i& first) {
    for (int z = 0; z < kEdge; ++z) {
      for (int y = 0; y < kEdge; ++y) {
        for (int x = 0; x < kEdge; ++x) {
          float value = 0;
          values_[index(x, y, z)] = tsdf.distance_at(first + Eigen::Vector3i(x, y, z), &value) ? value : NAN;
        }
      }
    }
  }
  float at(int x, int y, int z) const { return values_[index(x, y, z)]; }

 private:
  static std::size_t index(int x, int y, int z) { return static_cast<std::size_t>(x + kEdge * (y + kEdge * z)); }

  std::array<float, kEdge * kEdge * kEdge> values_;
};

class Mesher {
 public:
  explicit Mesher(const Tsdf& tsdf) : tsdf_(tsdf) {}

  PlyModel run() {
    const Eigen::Vector3i bricks = (tsdf_.region().size_voxels.array() + 7) / 8;
    std::size_t brick = 0;
    for (int z = 0; z < bricks.z(); ++z) {
      for (int y = 0; y < bricks.y(); ++y) {
        for (int x = 0; x < bricks.x(); ++x, ++brick) {
          if (tsdf_.find(brick) != nullptr) mesh_brick(8 * Eigen::Vector3i(x, y, z));
        }
      }
    }
    // Normals: the triangles' own, weighted by area.
    mesh_.normals.assign(mesh_.points.size(), Eigen::Vector3f::Zero());
    for (const auto& triangle : mesh_.triangles) {
      const Eigen::Vector3f& a = mesh_.points[triangle[0]];
      const Eigen::Vector3f normal = (mesh_.points[triangle[1]] - a).cross(mesh_.points[triangle[2]] - a);
      for (const std::uint32_t vertex : triangle) mesh_.normals[vertex] += normal;
    }
    for (Eigen::Vector3f& normal : mesh_.normals) {
      normal = normal.norm() > 0 ? normal.normalized() : Eigen::Vector3f::UnitZ();
    }
    return std::move(mesh_);
  }

 private:
  void mesh_brick(const Eigen::Vector3i& first) {
    const Block block(tsdf_, first);
    for (int z = 0; z < 8; ++z) {
      for (int y = 0; y < 8; ++y) {
        for (int x = 0; x < 8; ++x) {
          std::array<float, 8> values;
          unsigned inside = 0;
          bool known = true;
          for (int c = 0; c < 8; ++c) {
            const float value = block.at(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
            known = known && !std::isnan(value);
            values[static_cast<std::size_t>(c)] = value;
            inside |= (value < 0 ? 1U : 0U) << c;
          }
          if (known && inside != 0 && inside != 255) mesh_cell(first + Eigen::Vector3i(x, y, z), values, inside);
        }
      }
    }
  }

  void mesh_cell(const Eigen::Vector3i& cell, const std::array<float, 8>& values, unsigned inside) {
    for (const auto& edges : table_.triangles(inside)) {
      std::array<std::uint32_t, 3> triangle;
      for (std::size_t i = 0; i < 3; ++i) triangle[i] = vertex(cell, values, edges[i]);
      if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) continue;
      mesh_.triangles.push_back(triangle);
    }
  }

  /// The point where the distance is zero on an edge; one for all cells around the edge.
  std::uint32_t vertex(const Eigen::Vector3i& cell, const std::array<float, 8>& values, int edge) {
    const int axis = edge / 4;
    const int start = kEdgeStarts[static_cast<std::size_t>(axis)][static_cast<std::size_t>(edge % 4)];
    const Eigen::Vector3i voxel = cell + Eigen::Vector3i(start & 1, start >> 1 & 1, start >> 2);
    const std::uint64_t key = static_cast<std::uint64_t>(axis) | static_cast<std::uint64_t>(voxel.x()) << 2 |
                              static_cast<std::uint64_t>(voxel.y()) << 22 | static_cast<std::uint64_t>(voxel.z()) << 42;
    const auto [entry, fresh] = vertices_.try_emplace(key, static_cast<std::uint32_t>(mesh_.points.size()));
    if (fresh) {
      const double a = static_cast<double>(values[static_cast<std::size_t>(start)]);
      const double b = static_cast<double>(values[static_cast<std::size_t>(start | 1 << axis)]);
      Eigen::Vector3d point = tsdf_.region().center(voxel);
      point[axis] += tsdf_.region().resolution_m * a / (a - b);
      mesh_.points.push_back(point.cast<float>());
    }
    return entry->second;
  }

  const Tsdf& tsdf_;
  CaseTable table_;
  std::unordered_map<std::uint64_t, std::uint32_t> vertices_;
  PlyModel mesh_;
};

}  // namespace

PlyModel extract_mesh(const Tsdf& tsdf) { return Mesher(tsdf).run(); }

}  // namespace vantage
