#include "offboard/experiment/measured_scenes.h"

#include <cstdint>
#include <optional>

#include "offboard/experiment/run_store.h"

namespace vantage {

bool for_each_measured_scene(const std::vector<ExperimentObject>& objects, const MeasuredScenesOptions& options,
                             const std::atomic<bool>& stop,
                             const std::function<void(const SceneViews& scene, const SceneTruth& truth)>& use) {
  for (const ExperimentObject& object : objects) {
    for (int s = 1; s <= options.seeds; ++s) {
      const auto seed = static_cast<std::uint64_t>(s);
      std::filesystem::path folder;
      if (!options.cache.empty()) {
        folder = views_folder(options.cache, {object.name, object.digest}, seed, options.run.view_radius_m);
      }
      SceneViews scene(object, options.candidates.empty() ? candidates_of(options.run) : options.candidates, seed,
                       folder);
      if (!scene.prepare(options.threads, stop, [](int, int) {})) return false;
      const std::optional<SceneTruth> truth = measure_scene(scene, options.run, stop);
      if (!truth || stop) return false;
      use(scene, *truth);
    }
  }
  return true;
}

}  // namespace vantage
