// One frame of 640 x 480 on one thread, stage by stage and whole, and the last stages' share of a key frame.

#include <benchmark/benchmark.h>

#include "onboard/tracking/tracker.h"
#include "tests/onboard/tracking/textured_scene.h"

namespace vantage::tracking {
namespace {

CameraModel vga_camera() { return {.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 319.5, .cy = 239.5}; }

const std::vector<Frame>& frames() {
  static const std::vector<Frame> kFrames = [] {
    std::vector<Frame> made;
    for (std::uint64_t i = 0; i < 240; ++i) {
      made.push_back(TexturedScene::render(vga_camera(), TexturedScene::sway(static_cast<double>(i) / 30), i, 2));
    }
    return made;
  }();
  return kFrames;
}

void pyramid(benchmark::State& state) {
  const GreyImage picture = frames()[0].image;
  ImagePyramid image;
  for (auto unused : state) image.build(picture);
}

void rotation_alignment(benchmark::State& state) {
  ImagePyramid a, b;
  a.build(frames()[0].image);
  b.build(frames()[1].image);
  RotationAlignment rotation(vga_camera());
  for (auto unused : state) benchmark::DoNotOptimize(rotation.align(a, b));
}

void sparse_alignment(benchmark::State& state) {
  const CameraModel camera = vga_camera();
  ImagePyramid a, b;
  a.build(frames()[0].image);
  b.build(frames()[1].image);
  const Eigen::Isometry3d T = TexturedScene::sway(0);
  std::vector<AlignmentPoint> points;
  for (int i = 0; i < 170; ++i) {
    const Eigen::Vector2d pixel(40 + 33 * (i % 17), 40 + 40 * (i / 17));
    Eigen::Vector3d ray;
    double distance = 0;
    camera.unproject(pixel, &ray);
    TexturedScene::shade(T.translation(), T.linear() * ray, &distance);
    points.push_back({pixel, ray * distance});
  }
  SparseAlignment alignment(camera);
  for (auto unused : state) benchmark::DoNotOptimize(alignment.align(a, points, b, Eigen::Isometry3d::Identity()));
}

/// Everything, mapping included, on one thread; the median is over the frames after the start.
void whole_frame(benchmark::State& state) {
  std::vector<double> seconds;
  for (auto unused : state) {
    Tracker tracker(vga_camera());
    seconds.clear();
    for (const Frame& frame : frames()) {
      const auto from = std::chrono::steady_clock::now();
      const TrackingResult result = tracker.process(frame);
      const auto to = std::chrono::steady_clock::now();
      if (result.has_pose && !result.began_map) seconds.push_back(std::chrono::duration<double>(to - from).count());
    }
  }
  std::sort(seconds.begin(), seconds.end());
  state.counters["ms_median"] = 1e3 * seconds[seconds.size() / 2];
  state.counters["ms_p95"] = 1e3 * seconds[seconds.size() * 95 / 100];
  state.counters["tracked"] = static_cast<double>(seconds.size());
}

BENCHMARK(pyramid)->Unit(benchmark::kMicrosecond);
BENCHMARK(rotation_alignment)->Unit(benchmark::kMicrosecond);
BENCHMARK(sparse_alignment)->Unit(benchmark::kMicrosecond);
BENCHMARK(whole_frame)->Unit(benchmark::kMillisecond)->Iterations(1);

}  // namespace
}  // namespace vantage::tracking

BENCHMARK_MAIN();
