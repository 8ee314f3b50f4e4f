#include "offboard/experiment/view_set_planner.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "offboard/experiment/set_cover.h"
#include "offboard/experiment/surface_network.h"
#include "offboard/experiment/view_tour.h"

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

}  // namespace

std::size_t ViewSetPlanner::choose(const Choice& choice) {
  const Region& region = choice.map.region();
  if (!focus_) {
    focus_ = focus_of(choice.open, region.center(region.size_voxels / 2));
    taken_.push_back({choice.position(), {}});
  }
  const ExpectedSurface surface =
      expect_surface(SurfaceNetwork::built_in(), choice.map, choice.camera, choice.poses, *focus_);
  ExpectedViews expected(choice.map, surface, taken_, options_.expected);
  std::vector<std::vector<ExpectedVoxel>> views;
  for (const CandidateView& view : choice.open) {
    views.push_back(expected.see(expected.rays_for(choice.camera, view.T_world_camera), view.T_world_camera));
  }
  SetCover cover(views, expected.prior());
  double largest_gain = 0;
  for (std::size_t view = 0; view < views.size(); ++view) largest_gain = std::max(largest_gain, cover.gain(view));
  if (largest_gain <= 0) {  // nothing more to see
    const std::size_t chosen = nearest(choice);
    taken_.push_back({choice.open[chosen].T_world_camera.translation(), {}});
    return chosen;
  }
  if (first_gain_ == 0) first_gain_ = largest_gain;
  std::vector<Eigen::Vector3d> positions;
  for (const CandidateView& view : choice.open) positions.push_back(view.T_world_camera.translation());
  const double reference = std::sqrt(first_gain_ * largest_gain);
  const std::size_t chosen = best_tour(choice.position(), positions, reference, options_.tour, &cover).front();
  taken_.push_back({choice.open[chosen].T_world_camera.translation(), std::move(views[chosen])});
  return chosen;
}

}  // namespace vantage
