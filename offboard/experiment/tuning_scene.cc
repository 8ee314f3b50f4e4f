#include "offboard/experiment/tuning_scene.h"

#include <algorithm>
#include <bit>
#include <stdexcept>

#include "offboard/planning/volume.h"
#include "offboard/session/session_config.h"

namespace vantage {
namespace {

/// Candidates that are not visited, by place.
std::vector<std::size_t> open_places(std::size_t candidates, const std::vector<std::size_t>& visited) {
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < candidates; ++i) {
    if (std::find(visited.begin(), visited.end(), i) == visited.end()) open.push_back(i);
  }
  return open;
}

}  // namespace

/// The map of the first `integrated` views of a sequence.
struct TuningScene::GrowingMap {
  explicit GrowingMap(const ExperimentOptions& options) : volume(SessionConfig().region, sensor_of(options)) {}

  void grow(const SceneViews& views, const Sequence& visited) {
    for (; integrated < visited.size(); ++integrated) {
      const DepthMap depth = views.depth_map(visited[integrated]);
      const IntegrationResult result = volume.integrate(depth);
      if (!result.ok) throw std::logic_error("a depth map can't be integrated: " + result.error);
      camera = depth.camera;
    }
  }

  Volume volume;
  CameraModel camera;
  std::size_t integrated = 0;
};

TuningScene::TuningScene(const SceneViews& views, const SceneTruth& truth, const ExperimentOptions& options)
    : views_(views), truth_(truth), options_(options) {}

const std::vector<ViewGain>& TuningScene::gains_after(const Sequence& visited, GrowingMap* map) {
  const auto known = gains_.find(visited);
  if (known != gains_.end()) return known->second;
  map->grow(views_, visited);
  std::vector<Eigen::Isometry3d> poses;
  for (const std::size_t i : open_places(views_.candidates().size(), visited)) {
    poses.push_back(views_.candidates()[i].T_world_camera);
  }
  const RayBundle rays(map->camera, options_.choosing.ray_columns, options_.choosing.ray_rows);
  return gains_[visited] = evaluate_views(map->volume.map(), rays, poses);
}

std::vector<std::size_t> TuningScene::visit(const CombinedWeights& weights) {
  const std::vector<CandidateView>& candidates = views_.candidates();
  const auto views = std::min(static_cast<std::size_t>(options_.views), candidates.size());
  GrowingMap map(options_);
  Sequence visited{static_cast<std::size_t>(first_view_of_seed(views_.seed(), candidates.size()))};
  while (visited.size() < views) {
    const Sequence places = open_places(candidates.size(), visited);
    std::vector<CandidateView> open;
    for (const std::size_t i : places) open.push_back(candidates[i]);
    std::vector<double> combined;
    for (const ViewGain& gain : gains_after(visited, &map)) combined.push_back(combined_gain(gain, weights));
    const Eigen::Vector3d position = candidates[visited.back()].T_world_camera.translation();
    visited.push_back(places[choose_by_utility(open, position, combined, options_.choosing.cost_weight).place]);
  }
  return visited;
}

double TuningScene::area(const CombinedWeights& weights) {
  std::vector<std::uint64_t> covered;
  double sum = 0;
  std::size_t taken = 0, counted = 0;
  for (const std::size_t view : visit(weights)) {
    const std::vector<std::uint64_t>& more = truth_.by_view.covered[view];
    covered.resize(more.size());
    int points = 0;
    for (std::size_t w = 0; w < more.size(); ++w) points += std::popcount(covered[w] |= more[w]);
    if (++taken < 2 || taken > 12) continue;
    sum += static_cast<double>(points) / static_cast<double>(truth_.surface.size());
    ++counted;
  }
  return counted == 0 ? 0 : sum / static_cast<double>(counted);
}

std::array<double, kFormulations> TuningScene::first_gains() {
  GrowingMap map(options_);
  const std::vector<ViewGain>& gains =
      gains_after({static_cast<std::size_t>(first_view_of_seed(views_.seed(), views_.candidates().size()))}, &map);
  std::array<double, kFormulations> mean{};
  for (const ViewGain& gain : gains) {
    for (std::size_t f = 0; f < kFormulations; ++f) mean[f] += gain.value[f] / static_cast<double>(gains.size());
  }
  return mean;
}

ShapeDescriptor TuningScene::descriptor() const {
  GrowingMap map(options_);
  map.grow(views_, {static_cast<std::size_t>(first_view_of_seed(views_.seed(), views_.candidates().size()))});
  return describe_shape(map.volume.map());
}

}  // namespace vantage
