#include "offboard/experiment/view_set_planner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

#include "offboard/experiment/surface_network.h"

namespace vantage {
namespace {

/// The best order of the views in `set` by ViewSetPlanner's measure; at least one view.
std::vector<std::size_t> best_tour(const Choice& choice, std::vector<std::size_t> set, double reference,
                                   const ViewSetOptions& options, SetCover* cover) {
  std::sort(set.begin(), set.end());
  std::vector<std::size_t> best = set;
  double best_worth = -std::numeric_limits<double>::infinity();
  do {
    cover->clear();
    double worth = 0, discount = 1;
    Eigen::Vector3d at = choice.position();
    for (const std::size_t view : set) {
      const Eigen::Vector3d position = choice.open[view].T_world_camera.translation();
      worth += discount * (cover->gain(view) / reference - options.way_weight_per_m * (position - at).norm());
      cover->take(view);
      at = position;
      discount *= options.discount;
    }
    if (worth > best_worth) {
      best_worth = worth;
      best = set;
    }
  } while (std::next_permutation(set.begin(), set.end()));
  return best;
}

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

SetCover::SetCover(const std::vector<std::vector<ExpectedVoxel>>& views, const std::vector<float>& prior)
    : views_(views), prior_(prior), open_(prior) {}

double SetCover::gain(std::size_t view) const {
  double sum = 0;
  for (const ExpectedVoxel& seen : views_[view]) sum += static_cast<double>(open_[seen.voxel] * seen.probability);
  return sum;
}

void SetCover::take(std::size_t view) {
  taken_.push_back(view);
  for (const ExpectedVoxel& seen : views_[view]) open_[seen.voxel] *= 1 - seen.probability;
}

void SetCover::clear() {
  // What no taken view sees was never changed.
  for (const std::size_t view : taken_) {
    for (const ExpectedVoxel& seen : views_[view]) open_[seen.voxel] = prior_[seen.voxel];
  }
  taken_.clear();
}

std::vector<std::size_t> SetCover::take_greedily(std::size_t count, double least_share) {
  struct Bound {
    double gain;
    std::size_t view;
    std::size_t taken_then;  // views taken when the gain was computed
    bool operator<(const Bound& other) const { return gain != other.gain ? gain < other.gain : view > other.view; }
  };
  std::priority_queue<Bound> bounds;
  for (std::size_t view = 0; view < views_.size(); ++view) bounds.push({gain(view), view, 0});
  std::vector<std::size_t> taken;
  double first_gain = 0;
  while (taken.size() < count && !bounds.empty()) {
    Bound top = bounds.top();
    bounds.pop();
    if (top.taken_then != taken.size()) {
      top.gain = gain(top.view);
      top.taken_then = taken.size();
      bounds.push(top);
      continue;
    }
    if (taken.empty()) first_gain = top.gain;
    if (top.gain <= 0 || top.gain < least_share * first_gain) break;
    take(top.view);
    taken.push_back(top.view);
  }
  return taken;
}

std::size_t ViewSetPlanner::choose(const Choice& choice) {
  const Region& region = choice.map.region();
  if (!focus_) {
    focus_ = focus_of(choice.open, region.center(region.size_voxels / 2));
    taken_.push_back({choice.position(), {}});
  }
  const std::vector<float> surface =
      expect_surface(SurfaceNetwork::built_in(), choice.map, choice.camera, choice.poses, *focus_);
  ExpectedViews expected(choice.map, surface, taken_, options_.expected);
  std::vector<std::vector<ExpectedVoxel>> views;
  for (const CandidateView& view : choice.open) {
    views.push_back(expected.see(expected.rays_for(choice.camera, view.T_world_camera), view.T_world_camera));
  }
  SetCover cover(views, expected.prior());
  const std::vector<std::size_t> set = cover.take_greedily(options_.set_size, options_.least_share);
  if (set.empty()) {  // nothing more to see
    const std::size_t chosen = nearest(choice);
    taken_.push_back({choice.open[chosen].T_world_camera.translation(), {}});
    return chosen;
  }
  cover.clear();
  const double largest_gain = cover.gain(set.front());
  if (first_gain_ == 0) first_gain_ = largest_gain;
  const double held = std::pow(first_gain_, options_.hold) * std::pow(largest_gain, 1 - options_.hold);
  const double reference = std::max(held, options_.least_reference * first_gain_);
  const std::size_t chosen = best_tour(choice, set, reference, options_, &cover).front();
  taken_.push_back({choice.open[chosen].T_world_camera.translation(), std::move(views[chosen])});
  return chosen;
}

}  // namespace vantage
