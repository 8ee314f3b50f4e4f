#include "offboard/planning/planner.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "calib/files/input_error.h"

namespace vantage {

Planner::Planner(Volume& volume, std::vector<CandidateView> candidates, std::unique_ptr<ViewChooser> chooser,
                 const PlannerOptions& options)
    : volume_(volume),
      open_(std::move(candidates)),
      chooser_(std::move(chooser)),
      options_(options),
      enough_(options.enough) {
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
  visited_.push_back(depth_map.view_id);
  poses_.push_back(depth_map.T_world_camera);
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
    step->reason = fmt::format("the limit of {} views is reached", options_.most_views);
    return;
  }
  const double elapsed_s = static_cast<double>(depth_map.utime - first_utime_) * 1e-6;
  if (options_.most_seconds > 0 && elapsed_s >= options_.most_seconds) {
    step->reason = fmt::format("the limit of {} s is reached", options_.most_seconds);
    return;
  }
  if (open_.empty()) {
    step->reason = "every candidate has been visited";
    return;
  }
  const double way_left_m =
      options_.most_way_m > 0 ? options_.most_way_m - path_m_ : std::numeric_limits<double>::infinity();
  const std::vector<CandidateView> within = views_within(open_, last_position_, way_left_m);
  if (within.empty()) {
    step->reason = fmt::format("no view lies within the limit of {} m of way", options_.most_way_m);
    return;
  }
  ChosenView chosen = chooser_->choose({volume_.map(), depth_map.camera, within, visited_, poses_, way_left_m});
  step->scores = std::move(chosen.scores);
  if (std::optional<std::string> why = enough_.reached(step->scores)) {
    step->reason = *std::move(why);
    return;
  }
  step->next = within[chosen.place];
  step->reason = std::move(chosen.reason);
}

void Planner::correct(std::vector<Eigen::Isometry3d> poses) { poses_ = std::move(poses); }

}  // namespace vantage
