#include "offboard/lookahead/view_set_planner.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "offboard/lookahead/map_window.h"
#include "offboard/lookahead/set_cover.h"
#include "offboard/lookahead/surface_network.h"
#include "offboard/lookahead/view_tour.h"

namespace vantage {
namespace {

std::size_t nearest(const Choice& choice) {
  const auto distance = [&](const CandidateView& view) {
    return (view.T_world_camera.translation() - choice.position()).norm();
  };
  const auto found =
      std::min_element(choice.open.begin(), choice.open.end(),
                       [&](const CandidateView& a, const CandidateView& b) { return distance(a) < distance(b); });
  return static_cast<std::size_t>(found - choice.open.begin());
}

double mean_distance(std::span<const CandidateView> views, const Eigen::Vector3d& point) {
  constexpr double kLeast = 1e-3;  // at the point itself there is nothing to be seen of it
  double sum = 0;
  for (const CandidateView& view : views) sum += (view.T_world_camera.translation() - point).norm();
  return std::max(kLeast, sum / static_cast<double>(views.size()));
}

double way_between(const std::vector<TakenView>& views) {
  double way_m = 0;
  for (std::size_t i = 1; i < views.size(); ++i) way_m += (views[i].position - views[i - 1].position).norm();
  return way_m;
}

}  // namespace

ChosenView ViewSetPlanner::choose(const Choice& choice) {
  const Region& region = choice.map.region();
  if (!foot_) {
    foot_ = focus_of(choice.open, region.center(region.size_voxels / 2));
    distance_m_ = mean_distance(choice.open, *foot_);
    foot_->z() = options_.expected.ground_m;
  }
  for (std::size_t i = taken_.size(); i < choice.visited.size(); ++i) {
    const bool as_chosen = choice.visited[i] == promising_;
    taken_.push_back({Eigen::Vector3d::Zero(), as_chosen ? std::move(promised_) : std::vector<ExpectedVoxel>()});
  }
  for (std::size_t i = 0; i < taken_.size(); ++i) taken_[i].position = choice.poses[i].translation();

  const MapWindow window(choice.map, choice.camera, choice.poses, *foot_);
  const ExpectedSurface surface = SurfaceNetwork::built_in().expect(window);
  ExpectedViews expected(choice.map, surface, taken_, options_.expected);
  std::vector<std::vector<ExpectedVoxel>> views;
  std::vector<Eigen::Vector3d> positions;
  for (const CandidateView& view : choice.open) {
    views.push_back(expected.see(expected.rays_for(choice.camera, view.T_world_camera), view.T_world_camera));
    positions.push_back(view.T_world_camera.translation());
  }
  SetCover cover(views, expected.prior());
  ChosenView chosen;
  double largest_gain = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const double way_m = (positions[i] - choice.position()).norm();
    chosen.scores.push_back({choice.open[i].id, cover.gain(i), way_m, 0});
    largest_gain = std::max(largest_gain, chosen.scores.back().gain);
  }
  if (largest_gain <= 0) {
    chosen.place = nearest(choice);
    chosen.reason = "the nearest: nothing is expected of any";
  } else {
    if (first_gain_ == 0) first_gain_ = largest_gain;
    const double reference =
        std::pow(first_gain_, options_.first_share) * std::pow(largest_gain, 1 - options_.first_share);
    ViewTourOptions options = options_.tour;
    const double dearer = way_between(taken_) / (options_.dear_after * distance_m_);
    options.way_weight_per_m = options_.way_weight / distance_m_ * std::max(1.0, dearer * dearer);
    options.most_way_m = choice.way_left_m;
    for (ScoredView& view : chosen.scores) {
      view.utility = view.gain / reference - options.way_weight_per_m * view.cost;
    }
    const std::vector<std::size_t> tour = best_tour(choice.position(), positions, reference, options, &cover);
    chosen.place = tour.front();
    chosen.reason = "begins the best tour of " + std::to_string(tour.size()) + " views";
  }
  promising_ = choice.open[chosen.place].id;
  promised_ = std::move(views[chosen.place]);
  return chosen;
}

}  // namespace vantage
