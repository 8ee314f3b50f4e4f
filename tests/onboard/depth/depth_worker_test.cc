#include "onboard/depth/depth_worker.h"

#include <atomic>
#include <mutex>
#include <vector>

#include <gtest/gtest.h>

#include "onboard/depth/cpu_depth_backend.h"
#include "tests/onboard/depth/plane_scene.h"

namespace vantage {
namespace {

PlaneScene wall() {
  PlaneScene scene;
  scene.rectangles = {{.z = 1, .grain_m = 0.03}};
  return scene;
}

/// A backend that does nothing until it may: the filter is as slow as the test wants.
class HeldBackend : public DepthBackend {
 public:
  explicit HeldBackend(std::mutex* gate) : gate_(gate) {}
  void start(const GreyImage&, std::span<const PixelBelief>) override { const std::lock_guard wait(*gate_); }
  UpdateCounts update(const GreyImage&, const PairGeometry&) override {
    const std::lock_guard wait(*gate_);
    return {};
  }
  void read(std::span<PixelBelief>, std::span<PixelState>) const override {}

 private:
  std::mutex* gate_;
};

TEST(DepthWorkerTest, TakesTheNewestFrameAndCountsTheOthers) {
  const CameraModel camera = small_camera();
  const GreyImage image = photograph(wall(), camera, camera_at(0, 0, 0), 1);
  WorkerPool pool(1);
  DepthFilterOptions options;
  options.refine_poses = false;
  std::mutex gate;
  DepthWorker worker(
      std::make_unique<DepthFilter>(camera, options, KeyFrameOptions{}, std::make_unique<HeldBackend>(&gate), &pool),
      [](const DepthFilter&, const PosedImage&) {});
  {
    const std::lock_guard hold(gate);
    for (int i = 0; i < 10; ++i) worker.offer(posed(i, image, camera_at(0.001 * i, 0, 0)));
  }
  worker.drain();
  // The first may have been taken before the second came; of those that waited only the newest was.
  EXPECT_EQ(worker.used() + worker.passed_over(), 10U);
  EXPECT_LE(worker.used(), 2U);
}

TEST(DepthWorkerTest, HandsOutEachKeyFrameAndGoesOn) {
  const CameraModel camera = small_camera();
  const PlaneScene scene = wall();
  WorkerPool pool(2);
  DepthFilterOptions options;
  options.min_depth_m = 0.4;
  options.max_depth_m = 4;
  options.refine_poses = false;
  std::atomic<int> finished = 0;
  DepthWorker worker(std::make_unique<DepthFilter>(
                         camera, options, KeyFrameOptions{.enough_converged = 0.6},
                         std::make_unique<CpuDepthBackend>(camera.width, camera.height, options, &pool), &pool),
                     [&](const DepthFilter& filter, const PosedImage& key) {
                       ++finished;
                       EXPECT_EQ(filter.depth_map().utime, key.capture_time_ns / 1000);
                     });
  for (int i = 0; i < 60; ++i) {
    const Eigen::Isometry3d pose = camera_at(0.05 * std::sin(0.3 * i), 0.04 * std::sin(0.2 * i), 0);
    worker.offer(posed(i, photograph(scene, camera, pose, static_cast<std::uint64_t>(i)), pose));
    worker.drain();
  }
  EXPECT_EQ(worker.passed_over(), 0U);
  EXPECT_GE(finished, 2);
}

TEST(DepthWorkerTest, BeginsAnewWhenTheWorldHasMoved) {
  const CameraModel camera = small_camera();
  const PlaneScene scene = wall();
  WorkerPool pool(1);
  DepthFilterOptions options;
  options.refine_poses = false;
  std::vector<std::int64_t> keys;  // the worker's thread writes, this one reads after drain()
  DepthWorker worker(std::make_unique<DepthFilter>(
                         camera, options, KeyFrameOptions{.most_frames = 5},
                         std::make_unique<CpuDepthBackend>(camera.width, camera.height, options, &pool), &pool),
                     [&](const DepthFilter& filter, const PosedImage& key) {
                       EXPECT_EQ(filter.frames(), 5);
                       keys.push_back(key.capture_time_ns);
                     });
  const auto offer = [&](int i, bool anew) {
    const Eigen::Isometry3d pose = camera_at(0.01 * i, 0, 0);
    worker.offer(posed(i, photograph(scene, camera, pose, static_cast<std::uint64_t>(i)), pose), anew);
    worker.drain();
  };
  for (int i = 0; i < 4; ++i) offer(i, false);
  offer(4, true);  // what the first key frame had learnt is never told
  for (int i = 5; i < 10; ++i) offer(i, false);
  ASSERT_EQ(keys.size(), 1u);
  EXPECT_EQ(keys[0], posed(4, {}, camera_at(0, 0, 0)).capture_time_ns);
}

}  // namespace
}  // namespace vantage
