#include "offboard/planning/planner.h"

#include <algorithm>
#include <utility>

#include "calib/files/input_error.h"

namespace vantage {

Planner::Planner(Volume& volume, std::vector<CandidateView> candidates, GainFunction gain,
                 const PlannerOptions& options)
    : volume_(volume), open_(std::move(candidates)), gain_(std::move(gain)), options_(options) {
  const auto first = std::find_if(open_.begin(), open_.end(),
                                  [&](const CandidateView& view) { return view.id == options_.first_view; });
  if (first == open_.end()) {
    throw InputError("first_view: there is no view " + std::to_string(options_.first_view) + " among the " +
                     std::to_string(open_.size()) + " candidates");
  }
  goal_ = *first;
}

std::optional<PlannerStep> Planner::take(const DepthMap& depth_map, std::string* why) {
  if (state_ == PlannerState::kFinished) {
    *why = "the run is over";
    return std::nullopt;
  }
  const IntegrationResult integrated = volume_.integrate(depth_map);
  if (!integrated.ok) {
    *why = integrated.error;
    return std::nullopt;
  }
  const Eigen::Vector3d position = depth_map.T_world_camera.translation();
  if (steps_ == 0) {
    first_utime_ = depth_map.utime;
  } else {
    path_m_ += (position - last_position_).norm();
  }
  last_position_ = position;
  std::erase_if(open_, [&](const CandidateView& view) { return view.id == depth_map.view_id; });

  PlannerStep step;
  step.step = ++steps_;
  step.view_id = depth_map.view_id;
  step.path_m = path_m_;
  decide(depth_map, &step);
  goal_ = step.next;
  if (!goal_) state_ = PlannerState::kFinished;
  return step;
}

void Planner::decide(const DepthMap& depth_map, PlannerStep* step) {
  if (steps_ >= options_.most_views) {
    step->reason = "the limit of " + std::to_string(options_.most_views) + " views is reached";
    return;
  }
  const double elapsed_s = static_cast<double>(depth_map.utime - first_utime_) * 1e-6;
  if (options_.most_seconds > 0 && elapsed_s >= options_.most_seconds) {
    step->reason = "the limit of " + std::to_string(options_.most_seconds) + " s is reached";
    return;
  }
  if (open_.empty()) {
    step->reason = "every candidate has been visited";
    return;
  }
  std::vector<Eigen::Isometry3d> poses;
  for (const CandidateView& view : open_) poses.push_back(view.T_world_camera);
  const std::vector<double> gains = gain_(volume_.map(), depth_map.camera, poses);
  for (std::size_t i = 0; i < open_.size(); ++i) {
    const double cost = (open_[i].T_world_camera.translation() - last_position_).norm();
    step->scores.push_back({open_[i].id, gains[i], cost, 0});
  }
  compute_utilities(&step->scores);

  const bool enough = std::all_of(step->scores.begin(), step->scores.end(),
                                  [&](const ScoredView& view) { return view.gain < options_.gain_threshold; });
  if (enough) {  // Eq. 13
    step->reason = "no view gains " + std::to_string(options_.gain_threshold) + " any more";
    return;
  }
  const std::size_t best = *next_best_view(step->scores);
  step->next = open_[best];
  step->reason = "largest utility of " + std::to_string(open_.size()) + " views";
}

}  // namespace vantage
