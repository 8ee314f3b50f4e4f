#include "offboard/experiment/experiment.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <exception>
#include <mutex>
#include <ostream>
#include <thread>

#include <fmt/format.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

std::string minutes(double seconds) {
  const auto whole = static_cast<std::int64_t>(seconds + 0.5);
  return fmt::format("{}:{:02}", whole / 60, whole % 60);
}

/// Tells how far the work is. The unit is what one depth map costs to make; a run costs about as much as kRunCost.
class Progress {
 public:
  Progress(double total, std::ostream& terminal) : total_(total), terminal_(terminal) {}

  void add(double work) { done_ += work; }
  void say(const std::string& line) {
    const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
    const double left_s = done_ == 0 ? 0 : elapsed_s * std::max(0.0, total_ - done_) / done_;
    terminal_ << line << "; " << minutes(left_s) << " left" << std::endl;
  }

 private:
  double total_, done_ = 0;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  std::ostream& terminal_;
};
constexpr double kRunCost = 5;

/// Runs on one scene, several at a time.
bool run_scene(const SceneViews& scene, const std::vector<RunKey>& keys, const ExperimentOptions& options, int threads,
               const RunStore& store, const std::atomic<bool>& stop, Progress* progress) {
  const std::optional<SceneTruth> truth = measure_scene(scene, options, stop);
  if (!truth) return false;
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;  // guards failure, finished and *progress
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
        progress->add(kRunCost);
        progress->say(
            fmt::format("{} seed {} {}: coverage {:.3f} after {} views, {:.3f} over views 2-12, path {:.2f} m",
                        run->object, run->seed, run->method, run->steps.back().coverage, run->steps.size(),
                        area_2_12(*run), run->steps.back().motion_m));
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

  const std::vector<CandidateView> candidates = cylinder_views();
  double work = kRunCost * static_cast<double>(open);
  for (const Scene& scene : scenes) {
    const SceneViews views(*scene.object, candidates, scene.seed, store.views_of(scene.object->name, scene.seed));
    work += static_cast<double>(views.files_missing());
  }
  Progress progress(work, terminal);
  bool whole = true;
  for (const Scene& scene : scenes) {
    if (stop) return false;
    SceneViews scene_views(*scene.object, candidates, scene.seed, store.views_of(scene.object->name, scene.seed));
    int told = 0;
    const bool ready = scene_views.prepare(threads, stop, [&](int done, int missing) {
      progress.add(1);
      if (done < missing && done - told < 12) return;
      told = done;
      progress.say(fmt::format("{} seed {}: {} of {} views", scene.object->name, scene.seed, done, missing));
    });
    whole = ready && run_scene(scene_views, scene.runs, options, threads, store, stop, &progress);
    write_tables(store.folder(), store.read());
    if (!whole) return false;
  }
  write_tables(store.folder(), store.read());
  return true;
}

}  // namespace vantage
