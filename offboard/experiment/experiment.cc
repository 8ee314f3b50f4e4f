#include "offboard/experiment/experiment.h"

#include <algorithm>
#include <charconv>
#include <exception>
#include <mutex>
#include <ostream>
#include <thread>

#include <fmt/format.h>

#include "calib/files/input_error.h"
#include "offboard/experiment/progress.h"

namespace vantage {
namespace {

/// Runs on one scene, several at a time.
bool run_scene(const SceneViews& scene, const std::vector<RunKey>& keys, const ExperimentOptions& options, int threads,
               const RunStore& store, const std::atomic<bool>& stop, Progress* progress, std::ostream& terminal) {
  const std::optional<SceneTruth> truth = measure_scene(scene, options, stop);
  if (!truth) return false;
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;  // guards failure, finished, *progress and terminal
  std::exception_ptr failure;
  std::size_t finished = 0;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < keys.size(); i = next++) {
        const std::optional<MethodRun> run = run_method(scene, *truth, keys[i].method, options, stop);
        if (!run) return;
        store.write(*run);
        const std::lock_guard lock(mutex);
        ++finished;
        progress->run_made();
        terminal << fmt::format(
                        "{} seed {} {}: coverage {:.3f} after {} views, {:.3f} over views 2-12, path {:.2f} m; {}",
                        run->object, run->seed, run->method, run->steps.back().coverage, run->steps.size(),
                        area_2_12(*run), run->steps.back().motion_m, progress->text())
                 << std::endl;
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
      next = keys.size();
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(work);
  work();
  for (std::thread& thread : others) thread.join();
  if (failure) std::rethrow_exception(failure);
  return finished == keys.size();
}

}  // namespace

Shard Shard::parse(const std::string& text) {
  Shard shard;
  const char* const end = text.data() + text.size();
  const auto index = std::from_chars(text.data(), end, shard.index);
  if (index.ec == std::errc() && index.ptr != end && *index.ptr == '/') {
    const auto count = std::from_chars(index.ptr + 1, end, shard.count);
    if (count.ec == std::errc() && count.ptr == end && shard.index >= 1 && shard.index <= shard.count) return shard;
  }
  throw InputError("--shard " + text + ": expected i/n with 1 <= i <= n, e.g. 2/8");
}

std::vector<RunKey> list_runs(const std::vector<ExperimentObject>& objects, const std::vector<std::string>& methods,
                              int seeds) {
  std::vector<RunKey> runs;
  for (const ExperimentObject& object : objects) {
    for (int seed = 1; seed <= seeds; ++seed) {
      for (const std::string& method : methods) runs.push_back({object.name, method, static_cast<std::uint64_t>(seed)});
    }
  }
  return runs;
}

std::vector<RunKey> shard_of(const std::vector<RunKey>& all, const Shard& shard) {
  const auto part = [&](int i) {
    return static_cast<std::ptrdiff_t>(all.size() * static_cast<std::size_t>(i) /
                                       static_cast<std::size_t>(shard.count));
  };
  return {all.begin() + part(shard.index - 1), all.begin() + part(shard.index)};
}

bool run_experiment(const std::vector<ExperimentObject>& objects, const std::vector<RunKey>& runs,
                    const ExperimentOptions& options, int threads, const RunStore& store, const std::atomic<bool>& stop,
                    std::ostream& terminal) {
  struct Scene {
    const ExperimentObject* object;
    std::uint64_t seed;
    std::vector<RunKey> runs;
  };
  std::vector<Scene> scenes;
  std::size_t open = 0;
  for (const RunKey& key : runs) {
    if (store.holds(key)) continue;
    ++open;
    if (scenes.empty() || scenes.back().object->name != key.object || scenes.back().seed != key.seed) {
      const auto object = std::find_if(objects.begin(), objects.end(),
                                       [&](const ExperimentObject& other) { return other.name == key.object; });
      scenes.push_back({&*object, key.seed, {}});
    }
    scenes.back().runs.push_back(key);
  }
  if (open < runs.size()) terminal << runs.size() - open << " of " << runs.size() << " runs are finished" << std::endl;

  const std::vector<CandidateView> candidates = candidates_of(options);
  std::size_t views_missing = 0;
  for (const Scene& scene : scenes) {
    const SceneViews views(*scene.object, candidates, scene.seed, store.views_of(scene.object->name, scene.seed));
    views_missing += views.files_missing();
  }
  const SystemClock clock;
  Progress progress(clock, static_cast<int>(views_missing), static_cast<int>(open));
  bool whole = true;
  for (const Scene& scene : scenes) {
    if (stop) return false;
    SceneViews scene_views(*scene.object, candidates, scene.seed, store.views_of(scene.object->name, scene.seed));
    int told = 0;
    const bool ready = scene_views.prepare(threads, stop, [&](int done, int missing) {
      progress.view_made();
      if (done < missing && done - told < 12) return;
      told = done;
      terminal << fmt::format("{} seed {}: {} of {} views; {}", scene.object->name, scene.seed, done, missing,
                              progress.text())
               << std::endl;
    });
    whole = ready && run_scene(scene_views, scene.runs, options, threads, store, stop, &progress, terminal);
    write_tables(store.folder(), store.read());
    if (!whole) return false;
  }
  write_tables(store.folder(), store.read());
  return true;
}

}  // namespace vantage
