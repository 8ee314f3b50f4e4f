#include "offboard/planning/shape_descriptor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

namespace vantage {
namespace {

constexpr int kReach = 3;             // voxels: half the edge of the cube in which roughness is taken
constexpr int kFewestNeighbours = 8;  // fewer have no principal axes worth the name

Eigen::Vector3d principal_variances(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) covariance += (p - mean) * (p - mean).transpose();
  covariance /= static_cast<double>(points.size());
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance, Eigen::EigenvaluesOnly).eigenvalues();
}

double roughness_at(const OccupancyMap& map, const Eigen::Vector3i& voxel, int lowest_z) {
  std::vector<Eigen::Vector3d> around;
  for (int z = std::max(voxel.z() - kReach, lowest_z); z <= voxel.z() + kReach; ++z) {
    for (int y = voxel.y() - kReach; y <= voxel.y() + kReach; ++y) {
      for (int x = voxel.x() - kReach; x <= voxel.x() + kReach; ++x) {
        const Eigen::Vector3i other(x, y, z);
        if (!map.region().contains(other) || map.state(other) != VoxelState::kOccupied) continue;
        around.emplace_back(other.cast<double>());
      }
    }
  }
  if (around.size() < kFewestNeighbours) return 1.0 / 3;
  const Eigen::Vector3d variances = principal_variances(around);
  return variances.sum() > 0 ? std::max(0.0, variances[0]) / variances.sum() : 0;
}

/// Unknown voxels above the ground that lie behind a seen surface by up to half of d_max.
std::int64_t hidden_voxels(const OccupancyMap& map, int lowest_z) {
  std::int64_t hidden = 0;
  const int farthest = 1 + OccupancyMap::kMarkSteps / 2;
  for (std::size_t b = 0; b < map.brick_count(); ++b) {
    const OccupancyMap::Brick* brick = map.dense(b);
    if (brick == nullptr) continue;
    const int base_z = OccupancyMap::kBrickEdge * map.brick_position(b).z();
    for (std::size_t i = 0; i < OccupancyMap::kBrickVoxels; ++i) {
      if (base_z + static_cast<int>(i >> 6) < lowest_z || brick->mark[i] == 0 || brick->mark[i] > farthest) continue;
      const VoxelState state = map.levels().state(brick->level[i]);
      hidden += state == VoxelState::kUnobserved || state == VoxelState::kUncertain;
    }
  }
  return hidden;
}

}  // namespace

ShapeDescriptor describe_shape(const OccupancyMap& map) {
  const Region& region = map.region();
  const int lowest_z = std::max(
      0, static_cast<int>(std::ceil((ShapeDescriptor::kGround_m - region.min_corner.z()) / region.resolution_m)));
  std::vector<Eigen::Vector3i> occupied;
  map.for_each_occupied([&](const Eigen::Vector3i& voxel) {
    if (voxel.z() >= lowest_z) occupied.push_back(voxel);
  });
  ShapeDescriptor descriptor;
  if (occupied.empty()) return descriptor;

  std::vector<Eigen::Vector3d> flat;
  double mean_z = 0, roughness = 0;
  for (const Eigen::Vector3i& voxel : occupied) {
    flat.emplace_back(voxel.x(), voxel.y(), 0);
    mean_z += voxel.z();
    roughness += roughness_at(map, voxel, lowest_z);
  }
  const auto count = static_cast<double>(occupied.size());
  mean_z /= count;
  double variance_z = 0;
  for (const Eigen::Vector3i& voxel : occupied) variance_z += (voxel.z() - mean_z) * (voxel.z() - mean_z) / count;
  // A voxel's own spread is added, so that no ratio is taken of 0.
  const double own = 1.0 / 12;
  const Eigen::Vector3d across = principal_variances(flat);
  const double tall = std::sqrt(variance_z + own), wide = std::sqrt(across[2] + own), thin = std::sqrt(across[1] + own);
  descriptor.value = {std::log(tall / wide), std::log(thin / wide), std::log(count / std::pow(std::max(tall, wide), 2)),
                      roughness / count, std::log((1 + static_cast<double>(hidden_voxels(map, lowest_z))) / count)};
  return descriptor;
}

}  // namespace vantage
