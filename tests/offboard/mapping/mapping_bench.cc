// Integration of depth images against OctoMap's insertPointCloud, in one process.

#include <benchmark/benchmark.h>

#include "offboard/mapping/depth_history.h"
#include "offboard/mapping/occupancy_map.h"
#include "offboard/mapping/tsdf.h"
#include "tests/offboard/mapping/analytic_scene.h"
#include "tests/offboard/mapping/benchmark_report.h"
#include "tests/offboard/mapping/octomap_oracle.h"

namespace vantage {
namespace {

constexpr double kNoise = 0.001;  // m, standard deviation of the depth

Region region(double resolution_m) { return Region::cube({0, 0, 0.56}, 1.28, resolution_m); }

/// 640 x 480 images of the scene from views all round.
const std::vector<DepthMap>& images() {
  static const std::vector<DepthMap> kImages = [] {
    std::vector<DepthMap> maps;
    const auto views = ring_views();
    for (std::size_t i = 0; i < 20; ++i) {
      maps.push_back(AnalyticScene{}.depth_map(vga_camera(), views[i * 11 % 48], kNoise, static_cast<unsigned>(i)));
    }
    return maps;
  }();
  return kImages;
}

constexpr std::size_t kImagesTimed = 4;  // of which each iteration integrates all

void octomap_insert(benchmark::State& state) {
  const SensorModel model;
  std::vector<octomap::Pointcloud> clouds;
  for (std::size_t i = 0; i < kImagesTimed; ++i) {
    const DepthMap& map = images()[i];
    octomap::Pointcloud& cloud = clouds.emplace_back();
    std::size_t pixel = 0;
    for (int v = 0; v < map.camera.height; ++v) {
      for (int u = 0; u < map.camera.width; ++u, ++pixel) {
        if (map.state[pixel] != DepthState::kConverged) continue;
        const double depth = static_cast<double>(map.depth_m[pixel]);
        cloud.push_back(to_point3d(
            map.T_world_camera *
            (depth * Eigen::Vector3d((u - map.camera.cx) / map.camera.fx, (v - map.camera.cy) / map.camera.fy, 1))));
      }
    }
  }
  for (auto unused : state) {
    octomap::OcTree tree = make_octree(region(0.01), model);
    for (std::size_t i = 0; i < kImagesTimed; ++i) {
      tree.insertPointCloud(clouds[i], to_point3d(images()[i].T_world_camera.translation()), model.max_range_m);
    }
    benchmark::DoNotOptimize(tree.size());
  }
}

void integrate(benchmark::State& state, double resolution_m, bool with_tsdf) {
  OccupancyMap map(region(resolution_m));
  Tsdf tsdf(region(resolution_m));
  for (auto unused : state) {
    map.clear();
    tsdf.clear();
    for (std::size_t i = 0; i < kImagesTimed; ++i) {
      if (!map.integrate(images()[i], with_tsdf ? &tsdf : nullptr).ok) state.SkipWithError("refused");
    }
  }
  state.counters["map_MiB"] = static_cast<double>(map.memory_bytes()) / (1 << 20);
}

void rebuild_20(benchmark::State& state) {
  DepthHistory history(region(0.01), SensorModel{}, TsdfOptions{});
  for (std::size_t i = 0; i < images().size(); ++i) {
    if (!history.add(static_cast<std::int64_t>(i), images()[i]).ok) state.SkipWithError("refused");
  }
  for (auto unused : state) history.rebuild();
}

void correct_one_of_20(benchmark::State& state) {
  DepthHistory history(region(0.01), SensorModel{}, TsdfOptions{});
  for (std::size_t i = 0; i < images().size(); ++i) {
    if (!history.add(static_cast<std::int64_t>(i), images()[i]).ok) state.SkipWithError("refused");
  }
  Eigen::Isometry3d pose = images()[7].T_world_camera;
  double shift = 0.005;
  for (auto unused : state) {
    pose.translation().x() += shift;
    shift = -shift;
    if (!history.correct(7, pose).ok) state.SkipWithError("refused");
  }
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  images();
  const auto add = [](const char* name, auto function) {
    return benchmark::RegisterBenchmark(name, function)->Unit(benchmark::kMillisecond);
  };
  add("octomap_insert_4", octomap_insert)->Iterations(1)->Repetitions(2);
  add("integrate_4", [](benchmark::State& s) { integrate(s, 0.01, false); })->Iterations(4)->Repetitions(7);
  add("integrate_tsdf_4", [](benchmark::State& s) { integrate(s, 0.01, true); })->Iterations(4)->Repetitions(7);
  add("integrate_fine_4", [](benchmark::State& s) { integrate(s, 0.0025, false); })->Iterations(2)->Repetitions(5);
  add("rebuild_20", rebuild_20)->Iterations(1)->Repetitions(5);
  add("correct_one_of_20", correct_one_of_20)->Iterations(2)->Repetitions(3);
  BenchmarkReport report;
  benchmark::RunSpecifiedBenchmarks(&report);
  std::printf("\n");
  report.print("integrate_ratio_octomap", report.cpu("octomap_insert_4"), report.cpu("integrate_4"));
  report.print("integrate_tsdf_ratio_octomap", report.cpu("octomap_insert_4"), report.cpu("integrate_tsdf_4"));
  report.print("integrate_fine_ratio", report.cpu("integrate_fine_4"), report.cpu("integrate_4"));
  report.print("integrate_ms", report.cpu("integrate_4") * 1e3, kImagesTimed);
  report.print("rebuild_20_s", report.cpu("rebuild_20"), 1);
  report.print("correct_one_of_20_s", report.cpu("correct_one_of_20"), 1);
  return 0;
}
