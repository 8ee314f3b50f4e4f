#include "offboard/lookahead/expected_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "offboard/lookahead/voxel_rays.h"
#include "offboard/mapping/ray_walk.h"

namespace vantage {
namespace {

/// In voxels.
Eigen::Vector3d centre(const Region& region, std::uint32_t voxel) {
  return region.voxel_of(voxel).cast<double>() + Eigen::Vector3d::Constant(0.5);
}

/// Amounts by voxel of the region.
std::vector<float> by_voxel(const ExpectedSurface& surface, const Region& region) {
  std::vector<float> amounts(static_cast<std::size_t>(region.voxel_count()));
  std::size_t i = 0;
  for (int z = 0; z < surface.size.z(); ++z) {
    for (int y = 0; y < surface.size.y(); ++y) {
      for (int x = 0; x < surface.size.x(); ++x, ++i) {
        const Eigen::Vector3i voxel = surface.min_corner + Eigen::Vector3i(x, y, z);
        if (region.contains(voxel)) amounts[region.index_of(voxel)] = surface.amount[i];
      }
    }
  }
  return amounts;
}

}  // namespace

ExpectedViews::ExpectedViews(const OccupancyMap& map, const ExpectedSurface& surface, std::span<const TakenView> taken,
                             const ExpectedViewOptions& options)
    : region_(map.region()),
      surface_(surface),
      options_(options),
      prior_(by_voxel(surface, region_)),
      surroundings_(map, prior_, options.ground_m),
      taken_(taken),
      sight_(static_cast<std::size_t>(region_.voxel_count())) {
  constexpr float kMostProbable = 0.9F;
  for (std::size_t i = 0; i < prior_.size(); ++i) {
    const bool counts = surroundings_.near()[i] != 0 && static_cast<double>(prior_[i]) >= options_.least_prior;
    prior_[i] = counts ? std::min(kMostProbable, prior_[i]) : 0;
  }
  enclose();
  list_misses();
}

void ExpectedViews::enclose() {
  constexpr double kGroundLayers = 1.5;  // half a voxel of rounding, and what of the ground is taken for surface
  const double above = (options_.ground_m - region_.min_corner.z()) / region_.resolution_m + kGroundLayers;
  const int ground_end = static_cast<int>(std::ceil(above));
  Eigen::Vector3i low = region_.size_voxels, high = Eigen::Vector3i::Constant(-1);
  std::size_t i = 0;
  for (int z = 0; z < region_.size_voxels.z(); ++z) {
    for (int y = 0; y < region_.size_voxels.y(); ++y) {
      for (int x = 0; x < region_.size_voxels.x(); ++x, ++i) {
        if (prior()[i] == 0 && !(surroundings_.kind()[i] == VoxelSurroundings::kSolid && z >= ground_end)) continue;
        low = low.cwiseMin(Eigen::Vector3i(x, y, z));
        high = high.cwiseMax(Eigen::Vector3i(x, y, z));
      }
    }
  }
  box_min_ = low;
  box_size_ = (high - low + Eigen::Vector3i::Ones()).cwiseMax(0);
}

void ExpectedViews::list_misses() {
  first_miss_.assign(prior().size() + 1, 0);
  const auto each = [&](const auto& use) {
    for (const TakenView& view : taken_) {
      for (const ExpectedVoxel& voxel : view.expected) {
        if (prior()[voxel.voxel] > 0) use(view, voxel);
      }
    }
  };
  each([&](const TakenView&, const ExpectedVoxel& voxel) { ++first_miss_[voxel.voxel + 1]; });
  std::partial_sum(first_miss_.begin(), first_miss_.end(), first_miss_.begin());
  misses_.resize(first_miss_.back());
  std::vector<std::uint32_t> next(first_miss_.begin(), first_miss_.end() - 1);
  each([&](const TakenView& view, const ExpectedVoxel& voxel) {
    const Eigen::Vector3d to_camera = region_.to_voxels(view.position) - centre(region_, voxel.voxel);
    misses_[next[voxel.voxel]++] = {to_camera.normalized().cast<float>(), voxel.probability};
  });
}

double ExpectedViews::not_missed_again(std::uint32_t voxel, const Eigen::Vector3d& to_camera) const {
  double share = 1;
  for (std::uint32_t m = first_miss_[voxel]; m < first_miss_[voxel + 1]; ++m) {
    const double cosine = to_camera.dot(misses_[m].to_camera.cast<double>());
    if (cosine > 0) share *= 1 - misses_[m].probability * std::pow(cosine, options_.miss_exponent);
  }
  return share;
}

double ExpectedViews::detected(std::uint32_t voxel, const Eigen::Vector3d& to_camera) const {
  double share = options_.detected_unknown;
  if (const std::array<std::int8_t, 3>& facing = surroundings_.facing()[voxel];
      facing != std::array<std::int8_t, 3>{}) {
    const double cosine =
        Eigen::Vector3d(facing[0], facing[1], facing[2]).dot(to_camera) / VoxelSurroundings::kFacingUnit;
    share = options_.detected_averted;
    if (cosine > 0) {
      const double slant = 1 - std::min(cosine, 1.0);
      share = std::max(share, options_.detected_facing * (1 - std::pow(slant, options_.slant_exponent)));
    }
  }
  if (surface_.lean.empty()) return share;
  const std::size_t place = surface_.place(region_.voxel_of(voxel));
  const double lean = std::clamp(value_at(surface_.lean[place], to_camera), -options_.most_lean, options_.most_lean);
  return share * std::exp(lean);
}

const RayBundle& ExpectedViews::rays_for(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera) {
  const Eigen::Vector3d middle = box_min_.cast<double>() + 0.5 * box_size_.cast<double>();
  const std::pair<int, int> size =
      rays_a_voxel_apart(camera, (region_.to_voxels(T_world_camera.translation()) - middle).norm());
  return rays_.try_emplace(size, camera, size.first, size.second).first->second;
}

std::vector<ExpectedVoxel> ExpectedViews::see(const RayBundle& rays, const Eigen::Isometry3d& T_world_camera) {
  const Eigen::Vector3d camera = region_.to_voxels(T_world_camera.translation());
  const auto least = static_cast<float>(options_.least_sight);
  const auto opacity = static_cast<float>(options_.opacity);
  std::vector<ExpectedVoxel> seen;
  if ((box_size_.array() == 0).any()) return seen;
  const Eigen::Vector3d from = camera - box_min_.cast<double>();
  for (const Eigen::Vector3d& ray : rays.directions()) {
    float sight = 1;
    walk_ray(from, T_world_camera.linear() * ray, box_size_,
             [&](const Eigen::Vector3i& voxel, double enter, double leave) {
               const std::uint32_t i = region_.index_of(box_min_ + voxel);
               const std::uint8_t kind = surroundings_.kind()[i];
               if (kind == VoxelSurroundings::kFree) return true;
               if (kind == VoxelSurroundings::kSolid) return false;
               const float probability = prior_[i];
               if (probability > 0) {
                 if (sight_[i] == 0) seen.push_back({i, 0, Eigen::Vector3f::Zero()});
                 sight_[i] = std::max(sight_[i], sight);
               }
               sight *= std::max(0.0F, 1 - opacity * probability * static_cast<float>(leave - enter));
               return sight >= least;
             });
  }
  for (ExpectedVoxel& voxel : seen) {
    const Eigen::Vector3d to_camera = (camera - centre(region_, voxel.voxel)).normalized();
    const double sight = static_cast<double>(std::exchange(sight_[voxel.voxel], 0.0F));
    const double measured = std::min(options_.most_detected, sight * detected(voxel.voxel, to_camera));
    voxel.probability = static_cast<float>(measured * not_missed_again(voxel.voxel, to_camera));
    voxel.to_camera = to_camera.cast<float>();
  }
  return seen;
}

}  // namespace vantage
