#include "offboard/gain/view_gain.h"

#include <stdexcept>

#include "offboard/gain/cast_kernel.h"
#include "offboard/gain/gain_evaluator.h"

namespace vantage {

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
  set(Formulation::kCombined, combined_gain(gain, weights));
  return gain;
}

double combined_gain(const ViewGain& gain, const CombinedWeights& weights) {
  double combined = 0;  // Eq. 10
  for (const Formulation f : kAllFormulations) {
    if (f != Formulation::kCombined) combined += weights[f] * gain[f];
  }
  return combined;
}

bool GainOptions::valid(std::string* why) const {
  if (!weights.valid(why)) return false;
  if (threads < 1 || threads > 256) {
    if (why != nullptr) *why = "threads must lie between 1 and 256";
    return false;
  }
  return kernel.empty() || parse_kernel(kernel, why).has_value();
}

ViewGain evaluate_view(const OccupancyMap& map, const RayBundle& rays, const Eigen::Isometry3d& T_world_camera,
                       const GainOptions& options) {
  return evaluate_views(map, rays, {&T_world_camera, 1}, options)[0];
}

std::vector<ViewGain> evaluate_views(const OccupancyMap& map, const RayBundle& rays,
                                     std::span<const Eigen::Isometry3d> T_world_cameras, const GainOptions& options) {
  return GainEvaluator(rays, options).evaluate(map, T_world_cameras);
}

}  // namespace vantage
