// The simulator's exact depth is the oracle: it comes from ray casting, not from the images.
#include "drivers/camera/stereo_depth.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "drivers/sim/stereo_camera.h"

namespace vantage {
namespace {

using sim::StereoCamera;
using sim::StereoOptions;

GreyImage image_of(std::vector<std::uint8_t> pixels, const CameraModel& camera) {
  auto kept = std::make_shared<std::vector<std::uint8_t>>(std::move(pixels));
  return {camera.width, camera.height, camera.width, {kept, kept->data()}};
}

/// An octahedron that stands on a corner: slanted faces and sharp edges against ground and walls.
sim::Mesh octahedron() {
  sim::Mesh mesh;
  mesh.points = {{0.15F, 0, 0.15F}, {-0.15F, 0, 0.15F}, {0, 0.15F, 0.15F}, {0, -0.15F, 0.15F}, {0, 0, 0.3F}, {0, 0, 0}};
  for (std::uint32_t i = 0; i < 8; ++i) mesh.triangles.push_back({i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2)});
  return mesh;
}

class StereoDepthInRoom : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    sim::World world;
    world.object = octahedron();
    StereoOptions options;
    options.seed = static_cast<std::uint64_t>(GetParam());
    world.texture_seed = static_cast<std::uint32_t>(GetParam());
    const StereoCamera eyes(std::make_shared<sim::Renderer>(world), options);
    camera_ = options.camera;
    pose_ = look_at({0.55, 0.2, 0.35}, {0, 0, 0.12});
    std::vector<std::uint8_t> left(eyes.pixels()), right(eyes.pixels());
    eyes.capture(pose_, 1, left, right);
    frame_.capture_time_ns = 5'000;
    frame_.image = image_of(std::move(left), camera_);
    frame_.right_image = image_of(std::move(right), camera_);
    frame_.T_world_camera = pose_;
    eyes.renderer().depth(camera_, pose_, &truth_);
    baseline_m_ = options.baseline_m;
  }

  CameraModel camera_;
  double baseline_m_ = 0;
  Eigen::Isometry3d pose_;
  Frame frame_;
  std::vector<float> truth_;
};

TEST_P(StereoDepthInRoom, AgreesWithTheExactDepthWithinItsSigma) {
  StereoDepth stereo(camera_, baseline_m_);
  DepthMap map;
  std::string why;
  ASSERT_TRUE(stereo.compute(frame_, &map, &why)) << why;
  ASSERT_TRUE(map.valid(&why)) << why;
  EXPECT_EQ(map.utime, 5);
  std::vector<double> errors, normalised;
  std::size_t near = 0, wrong = 0;
  for (std::size_t i = 0; i < truth_.size(); ++i) {
    if (!(truth_[i] < 1.2F)) continue;
    ++near;
    if (map.state[i] != DepthState::kConverged) continue;
    const double error = std::abs(static_cast<double>(map.depth_m[i]) - static_cast<double>(truth_[i]));
    errors.push_back(error);
    normalised.push_back(error / static_cast<double>(map.sigma_m[i]));
    if (error > 0.015) ++wrong;
  }
  const auto quantile = [](std::vector<double>& values, double share) {
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size()));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
  };
  RecordProperty("median_error_um", static_cast<int>(1e6 * quantile(errors, 0.5)));
  // Bars from block matching at f = 448 px, b = 0.1 m measured elsewhere: median 0.7 mm at 0.6 m, 2 mm at 1 m.
  EXPECT_LT(quantile(errors, 0.5), 0.002);
  // A normal error stays within 1 sigma for 68 % and 3 sigma for 99.7 % of the pixels; matching has heavier tails.
  EXPECT_LT(quantile(normalised, 0.68), 1.0);
  EXPECT_LT(quantile(normalised, 0.97), 3.0);
  EXPECT_GT(static_cast<double>(errors.size()) / static_cast<double>(near), 0.6);
  // Gross errors would carve false surface: less than one in 500 after the edges are out.
  EXPECT_LT(static_cast<double>(wrong) / static_cast<double>(errors.size()), 0.002);
}

TEST_P(StereoDepthInRoom, TheEdgeFilterIsWhatKeepsGrossErrorsOut) {
  StereoDepth stereo(camera_, baseline_m_);
  DepthMap map;
  std::string why;
  ASSERT_TRUE(stereo.compute(frame_, &map, &why));
  const auto wrong_share = [&](DepthState state) {
    double all = 0, wrong = 0;
    for (std::size_t i = 0; i < truth_.size(); ++i) {
      if (map.state[i] != state || !(truth_[i] < 1.2F)) continue;
      ++all;
      if (std::abs(map.depth_m[i] - truth_[i]) > 0.015F) ++wrong;
    }
    return wrong / all;
  };
  EXPECT_GT(wrong_share(DepthState::kEdge), 10 * wrong_share(DepthState::kConverged));
}

INSTANTIATE_TEST_SUITE_P(Seeds, StereoDepthInRoom, testing::Values(1, 2, 3));

TEST(StereoDepth, RefusesFramesThatDoNotFit) {
  const CameraModel camera{64, 48, 40, 40, 32, 24, Distortion::kNone, {}};
  CameraModel small = camera;
  small.width = 32;
  StereoDepth stereo(camera, 0.1, {.disparities = 16});
  Frame frame;
  frame.image = image_of(std::vector<std::uint8_t>(64 * 48), camera);
  frame.right_image = image_of(std::vector<std::uint8_t>(32 * 48), small);
  frame.T_world_camera = Eigen::Isometry3d::Identity();
  DepthMap map;
  std::string why;
  EXPECT_FALSE(stereo.compute(frame, &map, &why));
  EXPECT_EQ(why, "an image is 32 x 48 pixels, the rig's camera 64 x 48");
  frame.right_image = {};
  EXPECT_FALSE(stereo.compute(frame, &map, &why));
  EXPECT_EQ(why, "the frame lacks one of its two images");
  frame.right_image = frame.image;
  frame.T_world_camera->translation().x() = std::nan("");
  EXPECT_FALSE(stereo.compute(frame, &map, &why));
  EXPECT_EQ(why, "the frame's pose is not known");
  EXPECT_TRUE(map.depth_m.empty());
}

TEST(StereoDepth, RefusesOptionsThatMakeNoSense) {
  const CameraModel camera{64, 48, 40, 40, 32, 24, Distortion::kNone, {}};
  EXPECT_THROW(StereoDepth(camera, 0), std::invalid_argument);
  EXPECT_THROW(StereoDepth(camera, 0.1, {.disparities = 100}), std::invalid_argument);
  EXPECT_THROW(StereoDepth(camera, 0.1, {.window = 4}), std::invalid_argument);
  EXPECT_THROW(StereoDepth(camera, 0.1, {.sigma_px = std::nan("")}), std::invalid_argument);
}

}  // namespace
}  // namespace vantage
