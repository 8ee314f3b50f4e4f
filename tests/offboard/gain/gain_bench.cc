// All gain formulations of 48 views against OctoMap in the style of the paper's release, in one process.

#include <benchmark/benchmark.h>

#include "offboard/gain/cast_kernel.h"
#include "offboard/gain/gain_evaluator.h"
#include "offboard/gain/incremental_gain.h"
#include "offboard/gain/view_gain.h"
#include "offboard/mapping/ray_walk.h"
#include "tests/offboard/gain/octomap_gain.h"
#include "tests/offboard/mapping/analytic_scene.h"
#include "tests/offboard/mapping/benchmark_report.h"

namespace vantage {
namespace {

constexpr int kColumns = 80, kRows = 60;
std::int64_t g_visits = 0;

OccupancyMap make_map(double resolution_m) {
  OccupancyMap map(Region::cube({0, 0, 0.56}, 1.28, resolution_m));
  const auto views = ring_views();
  for (std::size_t i = 0; i < 6; ++i) {
    map.integrate(AnalyticScene{}.depth_map(vga_camera(), views[i * 11 % 48], 0.001, static_cast<unsigned>(i)));
  }
  return map;
}

const OccupancyMap& coarse_map() {
  static const OccupancyMap kMap = make_map(0.01);
  return kMap;
}

const OccupancyMap& fine_map() {
  static const OccupancyMap kMap = make_map(0.0025);
  return kMap;
}

const RayBundle& rays() {
  static const RayBundle kRays(vga_camera(), kColumns, kRows);
  return kRays;
}

void octomap_release(benchmark::State& state) {
  OctomapGain oracle(coarse_map());
  const auto views = ring_views();
  std::int64_t visits = 0;
  for (auto unused : state) {
    const std::int64_t before = oracle.visits();
    for (const Eigen::Isometry3d& view : views) {
      std::vector<Eigen::Vector3d> directions = rays().directions();
      for (Eigen::Vector3d& direction : directions) direction = view.linear() * direction;
      benchmark::DoNotOptimize(oracle.evaluate(view.translation(), directions));
    }
    visits = oracle.visits() - before;
  }
  state.counters["visits"] = static_cast<double>(visits);
}

/// Encodes the map and casts all views, as a program does that keeps nothing between calls.
void evaluate_all(benchmark::State& state, CastKernel kernel, int threads) {
  GainOptions options;
  options.kernel = name_of(kernel);
  options.threads = threads;
  const auto views = ring_views();
  std::int64_t visits = 0;
  for (auto unused : state) {
    visits = 0;
    for (const ViewGain& gain : evaluate_views(coarse_map(), rays(), views, options)) visits += gain.sums.visits;
  }
  state.counters["visits"] = static_cast<double>(visits);
  g_visits = visits;
}

/// Casts all views through a field that is kept, as a session does.
void cast_kept(benchmark::State& state, const OccupancyMap& map, CastKernel kernel) {
  GainOptions options;
  options.kernel = name_of(kernel);
  const GainEvaluator evaluator(rays(), options);
  const GainField field(map);
  const auto views = ring_views();
  std::int64_t visits = 0;
  for (auto unused : state) {
    visits = 0;
    for (const ViewGain& gain : evaluator.evaluate(map, field, views)) visits += gain.sums.visits;
  }
  state.counters["visits"] = static_cast<double>(visits);
  state.counters["field_MiB"] = static_cast<double>(field.memory_bytes()) / (1 << 20);
}

/// The floor: two dependent loads a visit (code, table) at the places that the rays of one view meet, nothing else.
void gather_floor(benchmark::State& state) {
  const OccupancyMap& map = coarse_map();
  const GainField field(map);
  const FieldView view = field.view();
  const Eigen::Isometry3d pose = ring_views()[5];
  std::vector<std::int32_t> offsets;
  std::vector<std::vector<std::int32_t>> by_ray;
  for (const Eigen::Vector3d& ray : rays().directions()) {
    auto& of_ray = by_ray.emplace_back();
    walk_ray(map.region().to_voxels(pose.translation()), pose.linear() * ray, map.region().size_voxels,
             [&](const Eigen::Vector3i& v, double, double) {
               of_ray.push_back(view.first_offset + v.x() * view.strides[0] + v.y() * view.strides[1] +
                                v.z() * view.strides[2]);
               return map.state(v) != VoxelState::kOccupied;
             });
  }
  for (std::size_t first = 0; first + 16 <= by_ray.size(); first += 16) {  // in the kernels' order
    for (std::size_t step = 0; step < 400; ++step) {
      for (std::size_t i = first; i < first + 16; ++i) {
        if (step < by_ray[i].size()) offsets.push_back(by_ray[i][step]);
      }
    }
  }
  for (auto unused : state) {
    std::array<float, 8> sums{};
    for (std::size_t i = 0; i + 8 <= offsets.size(); i += 8) {
      for (std::size_t k = 0; k < 8; ++k) sums[k] += view.table->entropy[view.codes[offsets[i + k]] & kEntryMask];
    }
    benchmark::DoNotOptimize(sums);
  }
  state.counters["visits"] = static_cast<double>(offsets.size());
}

/// One more image, then all views up to date.
void incremental(benchmark::State& state) {
  OccupancyMap map = coarse_map();
  const auto views = ring_views();
  IncrementalGain gains(map, rays(), views);
  gains.update();
  std::size_t i = 6;
  double share = 0, count = 0;
  for (auto unused : state) {
    state.PauseTiming();
    map.integrate(AnalyticScene{}.depth_map(vga_camera(), views[i * 11 % 48], 0.001, static_cast<unsigned>(i)));
    ++i;
    state.ResumeTiming();
    benchmark::DoNotOptimize(gains.update());
    share += gains.recast_share();
    ++count;
  }
  state.counters["recast_share"] = share / count;
}

std::string kernel_benchmark(CastKernel kernel) { return "evaluate_48_" + std::string(name_of(kernel)); }

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  const auto add = [](const std::string& name, auto function) {
    return benchmark::RegisterBenchmark(name.c_str(), function)->Unit(benchmark::kMillisecond);
  };
  const CastKernel best = best_kernel();
  add("octomap_release_48", octomap_release)->Iterations(1)->Repetitions(2);
  for (const CastKernel kernel : available_kernels()) {
    add(kernel_benchmark(kernel), [kernel](benchmark::State& s) { evaluate_all(s, kernel, 1); })
        ->Iterations(3)
        ->Repetitions(7);
  }
  add("threads_1", [best](benchmark::State& s) { evaluate_all(s, best, 1); })
      ->Iterations(5)
      ->Repetitions(9)
      ->UseRealTime();
  add("threads_2", [best](benchmark::State& s) { evaluate_all(s, best, 2); })
      ->Iterations(5)
      ->Repetitions(9)
      ->UseRealTime();
  add("kept_field_128", [best](benchmark::State& s) { cast_kept(s, coarse_map(), best); })
      ->Iterations(5)
      ->Repetitions(7);
  add("kept_field_512", [best](benchmark::State& s) { cast_kept(s, fine_map(), best); })->Iterations(1)->Repetitions(5);
  add("gather_floor_one_view", gather_floor)->Repetitions(5);
  add("incremental_48", incremental)->Iterations(8)->Repetitions(2);
  BenchmarkReport report;
  benchmark::RunSpecifiedBenchmarks(&report);
  std::printf("\nbest kernel of this machine: %s\n\n", std::string(name_of(best)).c_str());
  const double octomap = report.cpu("octomap_release_48"), fastest = report.cpu(kernel_benchmark(best));
  report.print("gain_ratio_portable", octomap, report.cpu(kernel_benchmark(CastKernel::kPortable)));
  report.print("gain_ratio_best", octomap, fastest);
  report.print("gain_threads2_speedup", report.real("threads_1"), report.real("threads_2"));
  report.print("gain_ns_per_visit", 1e9 * fastest, static_cast<double>(g_visits));
  report.print("gain_floor_ns_per_visit", 1e9 * report.cpu("gather_floor_one_view"),
               report.counter("gather_floor_one_view"));
  report.print("gain_fine_ratio", report.cpu("kept_field_512"), report.cpu("kept_field_128"));
  report.print("gain_incremental_ratio", fastest, report.cpu("incremental_48"));
  return 0;
}
