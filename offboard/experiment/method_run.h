#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "offboard/experiment/methods.h"
#include "offboard/experiment/scene_views.h"

namespace vantage {

/// What is compared, and how; the paper's numbers (paper.md, Section IV-A).
struct ExperimentOptions {
  int views = 20;  ///< of a run, the first included
  ChooserOptions choosing;
  double clamp_min = 0.03, clamp_max = 0.97;  ///< of the map's probabilities (sensor_model.h)
  double view_radius_m = 0.6;                 ///< of the cylinder and half-sphere of candidates
  double most_way_m = 0;                      ///< of a run; 0: no limit
  double coverage_distance_m = 0.008;         ///< Eq. 14
  std::size_t truth_points = 50'000;
};

/// The paper's 48 candidates, at the options' radius.
std::vector<CandidateView> candidates_of(const ExperimentOptions& options);

/// The session's sensor model with the options' clamping.
SensorModel sensor_of(const ExperimentOptions& options);

/// Measures after one more view.
struct MethodStep {
  std::int64_t step = 0;  ///< views taken, from 1
  std::int64_t view_id = 0;
  double coverage = 0;      ///< Eq. 14
  double entropy_nats = 0;  ///< Eq. 15
  double motion_m = 0;      ///< length of the way so far
  // What the stages took, s of one thread; the one thing that another run does not repeat.
  double choose_s = 0;     ///< gains, costs, choice of this view
  double load_s = 0;       ///< its depth map out of the packed form
  double integrate_s = 0;  ///< into the map
  double measure_s = 0;    ///< cloud, coverage, entropy
};

/// One method on one object with one seed.
struct MethodRun {
  std::string object, method;
  std::uint64_t seed = 0;
  double reachable = 0;  ///< coverage after every candidate
  std::vector<MethodStep> steps;
};

/// What all runs on a scene share: the truth and what can be reached of it.
struct SceneTruth {
  std::vector<Eigen::Vector3f> surface;  ///< world, m
  double reachable = 0;                  ///< coverage after every candidate in the order of ids
  TrueCoverage by_view;                  ///< of each candidate's depth map by itself
};

/// \pre scene.prepare() was true. Nothing when `stop` was set.
std::optional<SceneTruth> measure_scene(const SceneViews& scene, const ExperimentOptions& options,
                                        const std::atomic<bool>& stop);

/// Depth map → map → choice, `options.views` times or until every candidate is visited; the classes are those of
/// vantage-offboard. The first view is first_view_of_seed. Where no candidate lies within the limit on the way, or none
/// gains the method's threshold, the camera stays: its steps repeat the last one, in no time. Nothing when `stop` was
/// set before the end. \pre scene.prepare() was true
std::optional<MethodRun> run_method(const SceneViews& scene, const SceneTruth& truth, const std::string& method,
                                    const ExperimentOptions& options, const std::atomic<bool>& stop);

/// Mean coverage over views 2 to 12: the area under the curve, scaled to [0, 1]. Of a shorter run, over what there is
/// of them; 0 for a run of one view.
double area_2_12(const MethodRun& run);

}  // namespace vantage
