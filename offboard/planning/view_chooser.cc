#include "offboard/planning/view_chooser.h"

#include <utility>

namespace vantage {

GainFunction gain_of(Formulation formulation, int ray_columns, int ray_rows, const GainOptions& options) {
  return [=](const OccupancyMap& map, const CameraModel& camera, const std::vector<Eigen::Isometry3d>& poses) {
    const RayBundle rays(camera, ray_columns, ray_rows);
    std::vector<double> gains;
    for (const ViewGain& view : evaluate_views(map, rays, poses, options)) gains.push_back(view[formulation]);
    return gains;
  };
}

UtilityChooser::UtilityChooser(GainFunction gain, double cost_weight)
    : gain_(std::move(gain)), cost_weight_(cost_weight) {}

ChosenView UtilityChooser::choose(const Choice& choice) {
  std::vector<Eigen::Isometry3d> poses;
  for (const CandidateView& view : choice.open) poses.push_back(view.T_world_camera);
  return choose_by_utility(choice.open, choice.position(), gain_(choice.map, choice.camera, poses), cost_weight_);
}

ChosenView choose_by_utility(std::span<const CandidateView> open, const Eigen::Vector3d& position,
                             std::span<const double> gains, double cost_weight) {
  ChosenView chosen;
  double costs = 0;
  for (std::size_t i = 0; i < gains.size(); ++i) {
    chosen.scores.push_back({open[i].id, gains[i], (open[i].T_world_camera.translation() - position).norm(), 0});
    costs += chosen.scores.back().cost;
  }
  compute_utilities(&chosen.scores);
  if (cost_weight != 1 && costs > 0) {
    for (ScoredView& view : chosen.scores) view.utility += (1 - cost_weight) * view.cost / costs;
  }
  chosen.place = *next_best_view(chosen.scores);
  chosen.reason = "largest utility of " + std::to_string(open.size()) + " views";
  return chosen;
}

}  // namespace vantage
