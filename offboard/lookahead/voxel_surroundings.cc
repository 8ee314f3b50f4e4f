#include "offboard/lookahead/voxel_surroundings.h"

#include <algorithm>
#include <cmath>

namespace vantage {
namespace {

constexpr float kLeastSurface = 0.01F;  // of a voxel whose facing is worth finding

struct Reached {
  std::array<std::int16_t, 3> voxel, source;  // source: the occupied voxel it is near to
};

}  // namespace

VoxelSurroundings::VoxelSurroundings(const OccupancyMap& map, std::span<const float> surface, double ground_m) {
  const auto voxels = static_cast<std::size_t>(map.region().voxel_count());
  kind_.assign(voxels, kUnknown);
  near_.assign(voxels, 0);
  facing_.assign(voxels, {});
  read(map);
  spread(map.region(), ground_m);
  face(map.region(), surface);
}

void VoxelSurroundings::read(const OccupancyMap& map) {
  const Eigen::Vector3i size = map.region().size_voxels;
  for (std::size_t b = 0; b < map.brick_count(); ++b) {
    const Eigen::Vector3i position = map.brick_position(b), extent = map.brick_extent(position);
    const OccupancyMap::Brick* dense = map.dense(b);
    for (int z = 0; z < extent.z(); ++z) {
      for (int y = 0; y < extent.y(); ++y) {
        const Eigen::Vector3i row = OccupancyMap::kBrickEdge * position + Eigen::Vector3i(0, y, z);
        std::size_t i = static_cast<std::size_t>(row.x()) +
                        static_cast<std::size_t>(size.x()) *
                            (static_cast<std::size_t>(row.y()) +
                             static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(row.z()));
        for (int x = 0; x < extent.x(); ++x, ++i) {
          const std::size_t in_brick = OccupancyMap::index_in_brick({x, y, z});
          const VoxelState state = map.levels().state(dense == nullptr ? map.uniform_level(b) : dense->level[in_brick]);
          kind_[i] = state == VoxelState::kFree ? kFree : state == VoxelState::kOccupied ? kSolid : kUnknown;
        }
      }
    }
  }
}

/// Distances go out from the occupied voxels above the ground, from neighbour to neighbour, each with its source; a
/// voxel keeps the first that reaches it, which is the nearest or misses it by a part of a voxel.
void VoxelSurroundings::spread(const Region& region, double ground_m) {
  const Eigen::Vector3i size = region.size_voxels;
  const std::array<std::ptrdiff_t, 3> stride = {1, size.x(), std::ptrdiff_t{size.x()} * size.y()};
  const auto index = [&](const std::array<std::int16_t, 3>& v) {
    return v[0] * stride[0] + v[1] * stride[1] + v[2] * stride[2];
  };
  const double above = (ground_m - region.min_corner.z()) / region.resolution_m + 0.5;  // centres from here on
  const int ground_end = std::clamp(static_cast<int>(std::ceil(above)), 0, size.z());
  const int object_begin = std::min(ground_end + 1, size.z());
  for (std::ptrdiff_t i = 0; i < ground_end * stride[2]; ++i) kind_[static_cast<std::size_t>(i)] = kSolid;

  std::vector<Reached> front, next;
  std::vector<std::uint8_t> reached(kind_.size());
  for (int z = object_begin; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) {
        const std::array<std::int16_t, 3> v = {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y),
                                               static_cast<std::int16_t>(z)};
        const auto i = static_cast<std::size_t>(index(v));
        if (kind_[i] != kSolid) continue;
        reached[i] = 1;
        front.push_back({v, v});
      }
    }
  }
  const double farthest = kFarthest_m / region.resolution_m;
  while (!front.empty()) {
    next.clear();
    for (const Reached& at : front) {
      for (int n = 0; n < 6; ++n) {
        Reached to = at;
        const int axis = n / 2;
        to.voxel[static_cast<std::size_t>(axis)] =
            static_cast<std::int16_t>(at.voxel[static_cast<std::size_t>(axis)] + (n % 2 == 0 ? 1 : -1));
        const std::int16_t c = to.voxel[static_cast<std::size_t>(axis)];
        if (c < (axis == 2 ? ground_end : 0) || c >= size[axis]) continue;
        const std::ptrdiff_t at_index = index(to.voxel);
        const auto i = static_cast<std::size_t>(at_index);
        if (reached[i] != 0) continue;
        int squared = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const int apart = to.voxel[k] - to.source[k];
          squared += apart * apart;
        }
        if (squared > farthest * farthest) continue;
        reached[i] = 1;
        next.push_back(to);
        if (kind_[i] == kUnknown) near_[i] = 1;
      }
    }
    std::swap(front, next);
  }
}

void VoxelSurroundings::face(const Region& region, std::span<const float> surface) {
  constexpr int kReach = 2;
  constexpr double kLeast = 3;  // of the sum of unit vectors
  struct Offset {
    Eigen::Vector3i voxel;
    Eigen::Vector3d unit;
  };
  std::vector<Offset> offsets;
  for (int z = -kReach; z <= kReach; ++z) {
    for (int y = -kReach; y <= kReach; ++y) {
      for (int x = -kReach; x <= kReach; ++x) {
        const Eigen::Vector3i offset(x, y, z);
        if (!offset.isZero()) offsets.push_back({offset, offset.cast<double>().normalized()});
      }
    }
  }
  const Eigen::Vector3i size = region.size_voxels;
  std::size_t i = 0;
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x, ++i) {
        if (near_[i] == 0 || surface[i] < kLeastSurface) continue;
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (const Offset& offset : offsets) {
          const Eigen::Vector3i other = Eigen::Vector3i(x, y, z) + offset.voxel;
          if (!region.contains(other)) continue;
          const auto j = static_cast<std::size_t>(other.x()) +
                         static_cast<std::size_t>(size.x()) *
                             (static_cast<std::size_t>(other.y()) +
                              static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(other.z()));
          if (kind_[j] == kFree) sum += offset.unit;
        }
        if (sum.norm() < kLeast) continue;
        const Eigen::Vector3d unit = sum.normalized() * kFacingUnit;
        for (std::size_t k = 0; k < 3; ++k) {
          facing_[i][k] = static_cast<std::int8_t>(std::lround(unit[static_cast<Eigen::Index>(k)]));
        }
      }
    }
  }
}

}  // namespace vantage
