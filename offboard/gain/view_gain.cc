#include "offboard/gain/view_gain.h"

#include <stdexcept>

#include "lcmtypes/link/depth_map.h"
#include "offboard/gain/reference_gain.h"

namespace vantage {

RaySums& RaySums::operator+=(const RaySums& other) {
  rays += other.rays;
  visits += other.visits;
  ends_occupied += other.ends_occupied;
  ends_occplane += other.ends_occplane;
  rear_side_voxels += other.rear_side_voxels;
  proximity_steps += other.proximity_steps;
  entropy += other.entropy;
  occlusion_aware += other.occlusion_aware;
  unobserved_voxel += other.unobserved_voxel;
  rear_side_entropy += other.rear_side_entropy;
  return *this;
}

ViewGain gain_of_sums(const RaySums& sums, double mark_step_m, const CombinedWeights& weights) {
  ViewGain gain;
  gain.sums = sums;
  const auto set = [&gain](Formulation f, double value) { gain.value[static_cast<std::size_t>(f)] = value; };
  set(Formulation::kEntropy, sums.entropy);
  set(Formulation::kOcclusionAware, sums.occlusion_aware);
  set(Formulation::kUnobservedVoxel, sums.unobserved_voxel);
  set(Formulation::kRearSideVoxel, static_cast<double>(sums.rear_side_voxels));
  set(Formulation::kRearSideEntropy, sums.rear_side_entropy);
  set(Formulation::kProximityCount, static_cast<double>(sums.proximity_steps) * mark_step_m);
  if (sums.visits > 0) set(Formulation::kAverageEntropy, sums.entropy / static_cast<double>(sums.visits));  // Eq. 17
  if (sums.rays > 0) {
    const auto rays = static_cast<double>(sums.rays);
    set(Formulation::kAreaFactor, area_factor(static_cast<double>(sums.ends_occupied) / rays, 0.2) +
                                      area_factor(static_cast<double>(sums.ends_occplane) / rays, 0.8));  // Eq. 18
  }
  double combined = 0;  // Eq. 10
  for (const Formulation f : kAllFormulations) {
    if (f != Formulation::kCombined) combined += weights[f] * gain[f];
  }
  set(Formulation::kCombined, combined);
  return gain;
}

bool GainOptions::valid(std::string* why) const {
  if (!weights.valid(why)) return false;
  if (threads >= 1 && threads <= 256) return true;
  if (why != nullptr) *why = "threads must lie between 1 and 256";
  return false;
}

ViewGain evaluate_view(const OccupancyMap& map, const RayBundle& rays, const Eigen::Isometry3d& T_world_camera,
                       const GainOptions& options) {
  return evaluate_views(map, rays, {&T_world_camera, 1}, options)[0];
}

std::vector<ViewGain> evaluate_views(const OccupancyMap& map, const RayBundle& rays,
                                     std::span<const Eigen::Isometry3d> T_world_cameras, const GainOptions& options) {
  std::string why;
  if (!options.valid(&why)) throw std::invalid_argument(why);
  std::vector<ViewGain> gains;
  for (const Eigen::Isometry3d& pose : T_world_cameras) {
    if (!is_rigid(pose)) {
      gains.emplace_back().reason = "the pose T_world_camera is not finite or not a rotation";
      continue;
    }
    gains.push_back(gain_of_sums(cast_rays_reference(map, rays, pose), map.mark_step_m(), options.weights));
    gains.back().marks_missing = !map.has_marks();
  }
  return gains;
}

}  // namespace vantage
