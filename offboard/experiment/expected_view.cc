#include "offboard/experiment/expected_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "offboard/mapping/ray_walk.h"

namespace vantage {
namespace {

std::size_t index_of(const Region& region, const Eigen::Vector3i& voxel) {
  const Eigen::Matrix<std::size_t, 3, 1> v = voxel.cast<std::size_t>(), size = region.size_voxels.cast<std::size_t>();
  return v.x() + size.x() * (v.y() + size.y() * v.z());
}

}  // namespace

ExpectedViews::ExpectedViews(const OccupancyMap& map, const ExpectedViewOptions& options)
    : region_(map.region()),
      options_(options),
      surface_(map),
      prior_(surface_.probability()),
      sight_(static_cast<std::size_t>(region_.voxel_count())) {}

void ExpectedViews::lessen(std::span<const float> left) {
  for (std::size_t i = 0; i < prior_.size(); ++i) prior_[i] *= left[i];
}

/// `camera`: its position, in voxels.
double ExpectedViews::detected(std::size_t voxel, const Eigen::Vector3d& camera) const {
  const std::array<std::int8_t, 3>& facing = surface_.facing()[voxel];
  if (facing == std::array<std::int8_t, 3>{}) return options_.detected_unknown;
  const auto width = static_cast<std::size_t>(region_.size_voxels.x()),
             depth = static_cast<std::size_t>(region_.size_voxels.y());
  const Eigen::Vector3d centre =
      Eigen::Matrix<std::size_t, 3, 1>(voxel % width, voxel / width % depth, voxel / width / depth)
          .cast<double>()
          .array() +
      0.5;
  const double cosine =
      Eigen::Vector3d(facing[0], facing[1], facing[2]).dot((camera - centre).normalized()) / SurfacePrior::kFacingUnit;
  const double slant = 1 - std::clamp(cosine, 0.0, 1.0);
  return std::max(options_.detected_averted, options_.detected_facing * (1 - std::pow(slant, options_.slant_exponent)));
}

std::vector<ExpectedVoxel> ExpectedViews::see(const RayBundle& rays, const Eigen::Isometry3d& T_world_camera) {
  const Eigen::Vector3d camera = region_.to_voxels(T_world_camera.translation());
  const auto least = static_cast<float>(options_.least_sight);
  const auto opacity = static_cast<float>(options_.opacity);
  std::vector<ExpectedVoxel> seen;
  for (const Eigen::Vector3d& ray : rays.directions()) {
    float sight = 1;
    walk_ray(camera, T_world_camera.linear() * ray, region_.size_voxels,
             [&](const Eigen::Vector3i& voxel, double, double) {
               const std::size_t i = index_of(region_, voxel);
               const std::uint8_t kind = surface_.kind()[i];
               if (kind == SurfacePrior::kFree) return true;
               if (kind == SurfacePrior::kSolid) return false;
               const float probability = surface_.probability()[i];
               if (probability > 0) {
                 if (sight_[i] == 0) seen.push_back({static_cast<std::uint32_t>(i), 0});
                 sight_[i] = std::max(sight_[i], sight);
               }
               sight *= 1 - opacity * probability;
               return sight >= least;
             });
  }
  for (ExpectedVoxel& voxel : seen) {
    voxel.probability = std::exchange(sight_[voxel.voxel], 0.0F) * static_cast<float>(detected(voxel.voxel, camera));
  }
  return seen;
}

}  // namespace vantage
