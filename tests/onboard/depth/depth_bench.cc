// Speed of the dense depth filter against a plain restatement of the published one, in the same run.

#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include <benchmark/benchmark.h>

#include "drivers/sim/boxes_room.h"
#include "drivers/sim/camera_path.h"
#include "drivers/sim/renderer.h"
#include "drivers/sim/sensor.h"
#include "onboard/depth/cpu_depth_backend.h"
#include "onboard/depth/depth_filter.h"
#include "onboard/depth/huber_tv.h"

namespace vantage {
namespace {

constexpr int kFrames = 30;

/// Key frame and 30 frames of the simulated hover, 640 x 480, noise of two grey levels.
struct Sequence {
  CameraModel camera{.width = 640, .height = 480, .fx = 460, .fy = 460, .cx = 319.5, .cy = 239.5, .coefficients = {}};
  std::vector<PosedImage> frames;

  static const Sequence& get() {
    static const Sequence sequence;
    return sequence;
  }

 private:
  Sequence() {
    const sim::Renderer renderer(sim::boxes_room(1));
    std::vector<float> radiance;
    for (int i = 0; i <= kFrames; ++i) {
      PosedImage frame;
      frame.capture_time_ns = 1 + i * 33'000'000LL;
      frame.T_world_camera = sim::pose_on_path(sim::CameraPath::kHover, i / 30.0);
      frame.covariance.diagonal().head<3>().setConstant(1e-6);
      frame.covariance.diagonal().tail<3>().setConstant(1e-6);
      renderer.render(camera, frame.T_world_camera, &radiance);
      auto pixels = std::make_shared<std::vector<std::uint8_t>>(radiance.size());
      sim::expose(radiance, sim::kReferenceExposure_s, 2, sim::noise_key(1, static_cast<std::uint64_t>(i), 0), *pixels);
      frame.image = {.width = camera.width,
                     .height = camera.height,
                     .stride = camera.width,
                     .pixels = std::shared_ptr<const std::uint8_t>(pixels, pixels->data())};
      frames.push_back(frame);
    }
  }
};

/// The published match: 5 x 5 zero-mean NCC every 0.7 px over +-3 sigma (at most 100 px), nearest pixels, every pixel,
/// one thread; the same belief.
double plain_frame_s(const Sequence& sequence, std::vector<PixelBelief>* beliefs, int number) {
  const CameraModel& camera = sequence.camera;
  const Eigen::Isometry3d T =
      sequence.frames[static_cast<std::size_t>(number)].T_world_camera.inverse() * sequence.frames[0].T_world_camera;
  PairGeometry g;
  g.fx = static_cast<float>(camera.fx);
  g.fy = static_cast<float>(camera.fy);
  g.cx = static_cast<float>(camera.cx);
  g.cy = static_cast<float>(camera.cy);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) g.rotation[3 * i + k] = static_cast<float>(T.linear()(i, k));
    g.translation[i] = static_cast<float>(T.translation()(i));
  }
  const std::uint8_t* key = sequence.frames[0].image.pixels.get();
  const std::uint8_t* other = sequence.frames[static_cast<std::size_t>(number)].image.pixels.get();
  const int w = camera.width, h = camera.height;
  const auto begin = std::chrono::steady_clock::now();
  for (int y = 3; y < h - 3; ++y) {
    for (int x = 3; x < w - 3; ++x) {
      PixelBelief& belief = (*beliefs)[static_cast<std::size_t>(y * w + x)];
      EpipolarLine line;
      if (!epipolar_line(g, static_cast<float>(x), static_cast<float>(y), belief.mean, &line)) continue;
      const float reach = std::min(50.0F, 3 * std::sqrt(belief.variance) * line.slope());
      float best = -1, best_s = 0;
      for (float s = -reach; s <= reach; s += 0.7F) {
        const int u = static_cast<int>(line.u0 + s * line.ex + 0.5F),
                  v = static_cast<int>(line.v0 + s * line.ey + 0.5F);
        if (u < 3 || v < 3 || u >= w - 3 || v >= h - 3) continue;
        float sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
        for (int dy = -2; dy <= 2; ++dy) {
          for (int dx = -2; dx <= 2; ++dx) {
            const float a = key[(y + dy) * w + x + dx], b = other[(v + dy) * w + u + dx];
            sa += a;
            sb += b;
            aa += a * a;
            bb += b * b;
            ab += a * b;
          }
        }
        const float ncc = (25 * ab - sa * sb) / std::sqrt((25 * aa - sa * sa) * (25 * bb - sb * sb) + 1e-3F);
        if (ncc > best) {
          best = ncc;
          best_s = s;
        }
      }
      if (best < 0.5F || line.slope() < 1) continue;
      const float tau = 1 / line.slope();
      belief = updated_belief(belief, line.inverse_depth(best_s), tau * tau, 3.2F);
    }
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Frame times of the filter, sorted, over `kFrames` frames of one key frame.
std::vector<double> filter_times_s(int threads, bool refine) {
  const Sequence& sequence = Sequence::get();
  WorkerPool pool(threads);
  DepthFilterOptions options;
  options.refine_poses = refine;
  DepthFilter filter(sequence.camera, options, {}, std::make_unique<CpuDepthBackend>(640, 480, options, &pool), &pool);
  filter.start(sequence.frames[0]);
  std::vector<double> times_s;
  for (int i = 1; i <= kFrames; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    filter.update(sequence.frames[static_cast<std::size_t>(i)]);
    times_s.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  std::sort(times_s.begin(), times_s.end());
  return times_s;
}

void BM_Filter(benchmark::State& state) {
  std::vector<double> times_s;
  for (auto _ : state) {
    times_s = filter_times_s(static_cast<int>(state.range(0)), state.range(1) != 0);
    double sum = 0;
    for (const double time : times_s) sum += time;
    state.SetIterationTime(sum / kFrames);
  }
  state.counters["slowest_ms"] = 1e3 * times_s.back();
}
BENCHMARK(BM_Filter)->Args({1, 0})->Args({2, 0})->Args({2, 1})->UseManualTime()->Iterations(3)->Unit(
    benchmark::kMillisecond);

void BM_PublishedMatch(benchmark::State& state) {
  const Sequence& sequence = Sequence::get();
  for (auto _ : state) {
    std::vector<PixelBelief> beliefs(640 * 480, {.mean = 1.7F, .variance = 0.3F, .inliers = 10, .outliers = 10});
    double sum = 0;
    for (int i = 3; i <= 12; i += 3) sum += plain_frame_s(sequence, &beliefs, i);
    state.SetIterationTime(sum / 4);
  }
}
BENCHMARK(BM_PublishedMatch)->UseManualTime()->Iterations(1)->Unit(benchmark::kMillisecond);

void BM_Smooth(benchmark::State& state) {
  const Sequence& sequence = Sequence::get();
  WorkerPool pool(2);
  DepthFilterOptions options;
  options.refine_poses = false;
  DepthFilter filter(sequence.camera, options, {}, std::make_unique<CpuDepthBackend>(640, 480, options, &pool), &pool);
  filter.start(sequence.frames[0]);
  for (int i = 1; i <= kFrames; ++i) filter.update(sequence.frames[static_cast<std::size_t>(i)]);
  const DepthMap map = filter.depth_map();
  HuberTvSmoother smoother(640, 480, {}, &pool);
  for (auto _ : state) {
    DepthMap smoothed = map;
    smoother.smooth(sequence.frames[0].image, &smoothed);
  }
}
BENCHMARK(BM_Smooth)->UseRealTime()->Unit(benchmark::kMillisecond);

/// Prints, after the table, the lines that docs/depth.md names.
class FigureReporter : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      const std::string name = run.benchmark_name();
      const double ms = run.GetAdjustedRealTime();
      if (name.find("BM_Filter/1/0") == 0) one_ms_ = ms;
      if (name.find("BM_Filter/2/1") == 0) {
        two_ms_ = ms;
        slowest_ms_ = run.counters.at("slowest_ms");
      }
      if (name.find("BM_PublishedMatch") == 0) published_ms_ = ms;
      if (name.find("BM_Smooth") == 0) smooth_ms_ = ms;
    }
    ConsoleReporter::ReportRuns(runs);
  }

  void print() const {
    std::printf("depth_fps_2core %.1f\n", 1e3 / two_ms_);
    std::printf("depth_slowest_frame_ms %.1f\n", slowest_ms_);
    std::printf("depth_over_published_1core %.2f\n", published_ms_ / one_ms_);
    std::printf("smooth_ms %.1f\n", smooth_ms_);
  }

 private:
  double one_ms_ = 0, two_ms_ = 0, slowest_ms_ = 0, published_ms_ = 0, smooth_ms_ = 0;
};

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  vantage::FigureReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  reporter.print();
}
