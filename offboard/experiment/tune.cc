#include "offboard/experiment/tune.h"

#include <memory>
#include <ostream>

#include <fmt/format.h>

#include "offboard/experiment/progress.h"
#include "offboard/experiment/run_store.h"

namespace vantage {
namespace {

constexpr const char* kWhole = "all";
std::string search_name(const ExperimentObject& object) { return "object:" + object.name; }

struct Scene {
  const ExperimentObject* object;
  SceneViews views;
  std::optional<SceneTruth> truth;
  std::optional<TuningScene> tuning;
};

std::vector<std::unique_ptr<Scene>> list_scenes(const std::vector<ExperimentObject>& objects,
                                                const TuneOptions& options) {
  const std::vector<CandidateView> candidates = candidates_of(options.run);
  std::vector<std::unique_ptr<Scene>> scenes;
  for (const ExperimentObject& object : objects) {
    for (int s = 1; s <= options.seeds; ++s) {
      const auto seed = static_cast<std::uint64_t>(s);
      const std::filesystem::path folder =
          options.cache.empty()
              ? std::filesystem::path()
              : views_folder(options.cache, {object.name, object.digest}, seed, options.run.view_radius_m);
      scenes.push_back(std::make_unique<Scene>(&object, SceneViews(object, candidates, seed, folder)));
    }
  }
  return scenes;
}

/// What is still to be done: views to render, and scenes to be run through by a search.
Progress progress_of(const Clock& clock, const std::vector<std::unique_ptr<Scene>>& scenes,
                     const std::vector<ExperimentObject>& objects, const TuneOptions& options,
                     const EvaluationLog& log) {
  std::size_t views = 0, runs = 0;
  for (const std::unique_ptr<Scene>& scene : scenes) views += scene->views.files_missing();
  for (std::size_t i = 0; i < static_cast<std::size_t>(options.search.evaluations); ++i) {
    if (!log.find(kWhole, i)) runs += scenes.size();
    for (const ExperimentObject& object : objects) {
      if (!log.find(search_name(object), i)) runs += static_cast<std::size_t>(options.seeds);
    }
  }
  return {clock, static_cast<int>(views), static_cast<int>(runs)};
}

}  // namespace

std::string describe(const std::vector<ExperimentObject>& objects, const TuneOptions& options) {
  const ExperimentOptions& run = options.run;
  std::string text = fmt::format(
      "seeds {}\nevaluations {}\nsearch_seed {}\nviews {}\ncost_weight {}\nrays {}x{}\nclamp {},{}\nview_radius {}\n",
      options.seeds, options.search.evaluations, options.search.seed, run.views, run.choosing.cost_weight,
      run.choosing.ray_columns, run.choosing.ray_rows, run.clamp_min, run.clamp_max, run.view_radius_m);
  for (const ExperimentObject& object : objects) text += fmt::format("object {} {}\n", object.name, object.digest);
  return text;
}

std::optional<LearnedWeights> tune_weights(const std::vector<ExperimentObject>& objects, const TuneOptions& options,
                                           const std::filesystem::path& log_path, const std::atomic<bool>& stop,
                                           std::ostream& terminal) {
  EvaluationLog log(log_path, describe(objects, options));
  const std::vector<std::unique_ptr<Scene>> scenes = list_scenes(objects, options);
  const SystemClock clock;
  Progress progress = progress_of(clock, scenes, objects, options, log);

  std::vector<TuningScene*> all;
  for (const std::unique_ptr<Scene>& scene : scenes) {
    const bool ready = scene->views.prepare(options.search.threads, stop, [&](int, int) { progress.view_made(); });
    if (!ready) return std::nullopt;
    scene->truth = measure_scene(scene->views, options.run, stop);
    if (!scene->truth) return std::nullopt;
    all.push_back(&scene->tuning.emplace(scene->views, *scene->truth, options.run));
    terminal << fmt::format("{} seed {}: reachable {:.3f}; {}", scene->object->name, scene->views.seed(),
                            scene->truth->reachable, progress.text())
             << std::endl;
  }

  const WeightCoordinates coordinates(all);
  const auto search = [&](const std::string& name, const std::vector<TuningScene*>& on, const Eigen::VectorXd& start) {
    int told = 0;
    const auto tell = [&](const FoundWeights& found) {
      for (std::size_t i = 0; i < on.size(); ++i) progress.run_made();
      if (++told % 10 != 0) return;
      terminal << fmt::format("{}: best {:.4f} over views 2-12, the first {:.4f}; {}", name, found.value,
                              found.value_of_start, progress.text())
               << std::endl;
    };
    const std::optional<FoundWeights> found =
        search_weights(name, on, coordinates, start, options.search, &log, stop, tell);
    if (found) {
      terminal << fmt::format("{}: learned {:.4f} over views 2-12, began at {:.4f}", name, found->value,
                              found->value_of_start)
               << std::endl;
    }
    return found;
  };
  const std::optional<FoundWeights> whole = search(kWhole, all, coordinates.of_weights(CombinedWeights()));
  if (!whole) return std::nullopt;
  std::vector<LearnedWeights::Object> learned;
  for (const ExperimentObject& object : objects) {
    std::vector<TuningScene*> own;
    std::vector<ShapeDescriptor> seen;
    for (const std::unique_ptr<Scene>& scene : scenes) {
      if (scene->object != &object) continue;
      own.push_back(&*scene->tuning);
      seen.push_back(scene->tuning->descriptor());
    }
    const std::optional<FoundWeights> found = search(search_name(object), own, whole->x);
    if (!found) return std::nullopt;
    learned.push_back({object.name, coordinates.weights_of(found->x), std::move(seen)});
  }
  return LearnedWeights(coordinates.weights_of(whole->x), std::move(learned));
}

}  // namespace vantage
