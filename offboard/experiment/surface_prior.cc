#include "offboard/experiment/surface_prior.h"

#include <algorithm>
#include <cmath>

namespace vantage {
namespace {

/// [distance][free neighbours][hiding]
constexpr std::array<float, SurfacePrior::kClasses> kProbability = {
    0.041F, 0.387F, 0.527F, 0.164F, 0.381F, 0.371F, 0.475F, 0.318F, 0.356F, 0.099F, 0.066F, 0.086F, 0.036F, 0.337F,
    0.398F, 0.342F, 0.448F, 0.374F, 0.612F, 0.491F, 0.348F, 0.202F, 0.135F, 0.116F, 0.042F, 0.253F, 0.315F, 0.392F,
    0.350F, 0.257F, 0.549F, 0.332F, 0.259F, 0.141F, 0.082F, 0.068F, 0.031F, 0.180F, 0.215F, 0.356F, 0.244F, 0.152F,
    0.447F, 0.259F, 0.168F, 0.078F, 0.068F, 0.042F, 0.024F, 0.122F, 0.128F, 0.272F, 0.147F, 0.096F, 0.293F, 0.182F,
    0.095F, 0.061F, 0.038F, 0.025F, 0.044F, 0.102F, 0.092F, 0.224F, 0.065F, 0.054F, 0.206F, 0.079F, 0.056F, 0.041F,
    0.012F, 0.012F, 0.103F, 0.128F, 0.060F, 0.114F, 0.032F, 0.031F, 0.095F, 0.022F, 0.027F, 0.022F, 0.003F, 0.006F,
    0.096F, 0.092F, 0.017F, 0.024F, 0.000F, 0.009F, 0.000F, 0.000F, 0.014F, 0.000F, 0.000F, 0.003F, 0.079F, 0.056F,
    0.003F, 0.002F, 0.000F, 0.006F, 0.000F, 0.000F, 0.006F, 0.000F, 0.000F, 0.001F};

constexpr std::array<double, SurfacePrior::kDistances - 1> kDistance_m = {0.015, 0.025, 0.035, 0.05,
                                                                          0.07,  0.10,  0.14,  0.17};
constexpr std::array<int, SurfacePrior::kNeighbourhoods - 1> kFreeNeighbours = {1, 6, 12};

constexpr float kLeastProbability = 0.01F;  // of a voxel whose facing is worth finding

/// By hiding, for voxels that face up and for others: what was found over what the table says, over the mean of both.
constexpr std::array<float, SurfacePrior::kHidings> kUp = {1.4F, 1.45F, 1.2F}, kNotUp = {1.35F, 0.85F, 0.6F};
constexpr double kUpward = 0.7;  // cosine
constexpr float kMostProbable = 0.9F;

struct Reached {
  std::array<std::int16_t, 3> voxel, source;  // source: the occupied voxel it is near to
};

}  // namespace

std::size_t SurfacePrior::class_of(double distance_m, int free_neighbours, double mark_m) {
  const auto distance = std::upper_bound(kDistance_m.begin(), kDistance_m.end(), distance_m) - kDistance_m.begin();
  const auto free =
      std::upper_bound(kFreeNeighbours.begin(), kFreeNeighbours.end(), free_neighbours) - kFreeNeighbours.begin();
  const std::ptrdiff_t hiding = mark_m < 0 ? 2 : mark_m > distance_m + kHiddenFarther_m ? 1 : 0;
  return static_cast<std::size_t>((distance * kNeighbourhoods + free) * kHidings + hiding);
}

SurfacePrior::SurfacePrior(const OccupancyMap& map) {
  const auto voxels = static_cast<std::size_t>(map.region().voxel_count());
  kind_.assign(voxels, kUnknown);
  class_.assign(voxels, kClasses);
  mark_m_.assign(voxels, -1);
  probability_.assign(voxels, 0);
  facing_.assign(voxels, {});
  read(map);
  spread(map.region());
  face(map.region());
}

void SurfacePrior::read(const OccupancyMap& map) {
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
          if (dense != nullptr && dense->mark[in_brick] != 0) {
            mark_m_[i] = static_cast<float>((dense->mark[in_brick] - 1) * map.mark_step_m());
          }
        }
      }
    }
  }
}

/// Distances go out from the occupied voxels above the ground, from neighbour to neighbour, each with its source; a
/// voxel keeps the first that reaches it, which is the nearest or misses it by a part of a voxel.
void SurfacePrior::spread(const Region& region) {
  const Eigen::Vector3i size = region.size_voxels;
  const std::array<std::ptrdiff_t, 3> stride = {1, size.x(), std::ptrdiff_t{size.x()} * size.y()};
  const auto index = [&](const std::array<std::int16_t, 3>& v) {
    return v[0] * stride[0] + v[1] * stride[1] + v[2] * stride[2];
  };
  const double above = (kGround_m - region.min_corner.z()) / region.resolution_m + 0.5;  // centres from here on
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
        const double distance = std::sqrt(static_cast<double>(squared));
        if (distance > farthest) continue;
        reached[i] = 1;
        next.push_back(to);
        if (kind_[i] != kUnknown) continue;
        int free = 0;
        for (int d = 0; d < 27; ++d) {
          const std::array<int, 3> o = {to.voxel[0] + d % 3 - 1, to.voxel[1] + d / 3 % 3 - 1, to.voxel[2] + d / 9 - 1};
          bool inside = true;
          for (int k = 0; k < 3; ++k)
            inside = inside && o[static_cast<std::size_t>(k)] >= 0 && o[static_cast<std::size_t>(k)] < size[k];
          if (inside)
            free += kind_[static_cast<std::size_t>(o[0] * stride[0] + o[1] * stride[1] + o[2] * stride[2])] == kFree;
        }
        const std::size_t entry = class_of(distance * region.resolution_m, free, static_cast<double>(mark_m_[i]));
        class_[i] = static_cast<std::uint8_t>(entry);
        probability_[i] = kProbability[entry];
      }
    }
    std::swap(front, next);
  }
}

void SurfacePrior::face(const Region& region) {
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
        if (probability_[i] < kLeastProbability) continue;
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
        if (sum.norm() < kLeast) {
          probability_[i] = std::min(kMostProbable, probability_[i] * kNotUp[class_[i] % kHidings]);
          continue;
        }
        const Eigen::Vector3d unit = sum.normalized() * kFacingUnit;
        for (std::size_t k = 0; k < 3; ++k) {
          facing_[i][k] = static_cast<std::int8_t>(std::lround(unit[static_cast<Eigen::Index>(k)]));
        }
        probability_[i] = std::min(
            kMostProbable, probability_[i] * (unit.z() > kUpward * kFacingUnit ? kUp : kNotUp)[class_[i] % kHidings]);
      }
    }
  }
}

}  // namespace vantage
