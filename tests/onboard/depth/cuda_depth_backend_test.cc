#include "onboard/depth/cuda_depth_backend.h"

#include <chrono>
#include <cmath>

#include <gtest/gtest.h>

#include "onboard/depth/cpu_depth_backend.h"
#include "tests/onboard/depth/plane_scene.h"

namespace vantage {
namespace {

/// The same frames through both: beliefs and states agree in 99.5 % of the pixels, after the first frame and after
/// many.
TEST(CudaDepthBackendTest, AgreesWithTheCpu) {
  if (!CudaDepthBackend::available()) GTEST_SKIP() << "NOT TESTED: no CUDA device";
  const CameraModel camera = small_camera();
  PlaneScene scene;
  scene.rectangles = {{.z = 1.2, .grain_m = 0.03, .slope = 0.2, .seed = 1},
                      {.z = 0.7, .centre = {-0.1, 0}, .half = {0.12, 0.1}, .grain_m = 0.02, .seed = 2}};
  DepthFilterOptions options;
  options.min_depth_m = 0.4;
  options.max_depth_m = 4;
  options.refine_poses = false;
  WorkerPool pool(2);
  DepthFilter cpu(camera, options, {}, std::make_unique<CpuDepthBackend>(camera.width, camera.height, options, &pool),
                  &pool);
  DepthFilter gpu(camera, options, {}, std::make_unique<CudaDepthBackend>(camera.width, camera.height, options), &pool);
  for (int i = 0; i <= 30; ++i) {
    const Eigen::Isometry3d pose = camera_at(0.04 * std::sin(0.35 * i), 0.04 * std::sin(0.23 * i),
                                             0.01 * std::sin(0.19 * i), 0.017 * std::sin(0.27 * i));
    const PosedImage frame = posed(i, photograph(scene, camera, pose, static_cast<std::uint64_t>(i + 1)), pose);
    for (DepthFilter* filter : {&cpu, &gpu}) {
      ASSERT_EQ(i == 0 ? filter->start(frame) : filter->update(frame), FrameUse::kUsed);
    }
    if (i == 0 || i % 10 != 0) continue;
    std::vector<PixelBelief> a, b;
    std::vector<PixelState> sa, sb;
    cpu.read(&a, &sa);
    gpu.read(&b, &sb);
    int agree = 0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      const bool same = std::abs(a[k].mean - b[k].mean) <= 0.005F * a[k].mean;
      agree += same && sa[k] == sb[k] ? 1 : 0;
    }
    EXPECT_GE(agree, 0.995 * static_cast<double>(a.size())) << "frame " << i;
  }
}

}  // namespace
}  // namespace vantage
