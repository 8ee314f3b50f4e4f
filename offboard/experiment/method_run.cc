#include "offboard/experiment/method_run.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "drivers/sim/surface_samples.h"
#include "offboard/planning/utility.h"
#include "offboard/planning/volume.h"
#include "offboard/session/session_config.h"
#include "offboard/session/surface_coverage.h"

namespace vantage {
namespace {

/// Seconds since it was last asked.
class StopWatch {
 public:
  double lap_s() {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Which points of the surface lie nearer than `distance_m` to one of `points`.
std::vector<std::uint64_t> covered_points(const std::vector<Eigen::Vector3f>& surface,
                                          const std::vector<Eigen::Vector3f>& points, double distance_m) {
  const auto distance = static_cast<float>(distance_m);
  const auto cell_of = [&](const Eigen::Vector3f& p) -> Eigen::Vector3i {
    return (p / distance).array().floor().cast<int>();
  };
  const auto key_of = [](const Eigen::Vector3i& c) {
    constexpr int kBits = 21;
    constexpr std::int64_t kMask = (std::int64_t{1} << kBits) - 1;
    return (c.x() & kMask) << 2 * kBits | (c.y() & kMask) << kBits | (c.z() & kMask);
  };
  std::unordered_map<std::int64_t, std::vector<Eigen::Vector3f>> cells;
  for (const Eigen::Vector3f& point : points) cells[key_of(cell_of(point))].push_back(point);
  const auto near = [&](const Eigen::Vector3f& p) {
    for (int n = 0; n < 27; ++n) {
      const auto cell = cells.find(key_of(cell_of(p) + Eigen::Vector3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)));
      if (cell == cells.end()) continue;
      for (const Eigen::Vector3f& other : cell->second) {
        if ((other - p).squaredNorm() < distance * distance) return true;
      }
    }
    return false;
  };
  std::vector<std::uint64_t> bits((surface.size() + 63) / 64);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    if (near(surface[i])) bits[i / 64] |= std::uint64_t{1} << i % 64;
  }
  return bits;
}

}  // namespace

std::vector<CandidateView> candidates_of(const ExperimentOptions& options) {
  CylinderViewsOptions views;
  views.radius_m = options.view_radius_m;
  return cylinder_views(views);
}

SensorModel sensor_of(const ExperimentOptions& options) {
  SensorModel sensor = SessionConfig().sensor;
  sensor.clamp_min = options.clamp_min;
  sensor.clamp_max = options.clamp_max;
  return sensor;
}

std::optional<SceneTruth> measure_scene(const SceneViews& scene, const ExperimentOptions& options,
                                        const std::atomic<bool>& stop) {
  const SessionConfig session;  // region and cloud as vantage-offboard has them
  SceneTruth truth;
  truth.surface = sim::sample_surface(scene.object().mesh, options.truth_points, scene.seed());
  SurfaceCloud cloud(session.region, session.cloud);
  SurfaceCoverage coverage(truth.surface, options.coverage_distance_m);
  for (std::size_t i = 0; i < scene.candidates().size(); ++i) {
    if (stop) return std::nullopt;
    const DepthMap map = scene.depth_map(i);
    coverage.add(cloud.add(map));
    truth.by_view.view_ids.push_back(scene.candidates()[i].id);
    const std::vector<Eigen::Vector3f> alone = SurfaceCloud(session.region, session.cloud).add(map);
    truth.by_view.covered.push_back(covered_points(truth.surface, alone, options.coverage_distance_m));
  }
  truth.reachable = coverage.share();
  return truth;
}

std::optional<MethodRun> run_method(const SceneViews& scene, const SceneTruth& truth, const std::string& method,
                                    const ExperimentOptions& options, const std::atomic<bool>& stop) {
  const SessionConfig session;
  MethodRun run{scene.object().name, method, scene.seed(), truth.reachable, {}};
  Volume volume(session.region, sensor_of(options));
  SurfaceCloud cloud(session.region, session.cloud);
  SurfaceCoverage coverage(truth.surface, options.coverage_distance_m);
  const std::unique_ptr<ViewChooser> chooser = make_chooser(method, scene.seed(), truth.by_view, options.choosing);
  std::vector<CandidateView> open = scene.candidates();
  std::vector<std::int64_t> visited;
  std::vector<Eigen::Isometry3d> poses;
  CameraModel camera;
  double motion_m = 0;
  GainStop enough({.share = known_share_of(method, options.choosing)});

  const auto views = std::min(static_cast<std::size_t>(options.views), scene.candidates().size());
  CandidateView view = open[static_cast<std::size_t>(first_view_of_seed(scene.seed(), scene.candidates().size()))];
  while (visited.size() < views) {
    if (stop) return std::nullopt;
    MethodStep step;
    StopWatch watch;
    if (!visited.empty()) {
      const double way_left_m =
          options.most_way_m > 0 ? options.most_way_m - motion_m : std::numeric_limits<double>::infinity();
      const std::vector<CandidateView> within = views_within(open, poses.back().translation(), way_left_m);
      if (within.empty()) break;
      const ChosenView chosen = chooser->choose({volume.map(), camera, within, visited, poses, way_left_m});
      if (enough.reached(chosen.scores)) break;
      view = within[chosen.place];
    }
    step.choose_s = watch.lap_s();

    const auto place = std::find_if(scene.candidates().begin(), scene.candidates().end(),
                                    [&](const CandidateView& candidate) { return candidate.id == view.id; });
    const DepthMap map = scene.depth_map(static_cast<std::size_t>(place - scene.candidates().begin()));
    step.load_s = watch.lap_s();

    const IntegrationResult integrated = volume.integrate(map);
    if (!integrated.ok) throw std::logic_error("a depth map can't be integrated: " + integrated.error);
    step.integrate_s = watch.lap_s();

    coverage.add(cloud.add(map));
    step.step = static_cast<std::int64_t>(visited.size()) + 1;
    step.view_id = view.id;
    step.coverage = coverage.share();
    step.entropy_nats = volume.map().entropy_nats();
    if (!visited.empty()) motion_m += (view.T_world_camera.translation() - poses.back().translation()).norm();
    step.motion_m = motion_m;
    step.measure_s = watch.lap_s();
    run.steps.push_back(step);

    camera = map.camera;
    poses.push_back(view.T_world_camera);
    visited.push_back(view.id);
    std::erase_if(open, [&](const CandidateView& other) { return other.id == view.id; });
  }
  while (run.steps.size() < views) {
    const MethodStep& last = run.steps.back();
    run.steps.push_back({last.step + 1, last.view_id, last.coverage, last.entropy_nats, last.motion_m, 0, 0, 0, 0});
  }
  return run;
}

double area_2_12(const MethodRun& run) {
  double sum = 0;
  int views = 0;
  for (const MethodStep& step : run.steps) {
    if (step.step < 2 || step.step > 12) continue;
    sum += step.coverage;
    ++views;
  }
  return views == 0 ? 0 : sum / views;
}

}  // namespace vantage
