#include "drivers/sim/stereo_camera.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "box.h"
#include "calib/look_at.h"

namespace vantage::sim {
namespace {

World world_with_box() {
  World world;
  world.object = Box{{-0.15, -0.1, 0}, {0.15, 0.1, 0.2}}.mesh();
  return world;
}

/// Half the size of the real one, to save time.
StereoOptions small_camera() {
  StereoOptions options;
  options.camera = {376, 240, 224, 224, 187.5, 119.5, Distortion::kNone, {}};
  return options;
}

struct Pair {
  std::vector<std::uint8_t> left, right;
  bool operator==(const Pair&) const = default;
};

Pair take(const StereoCamera& camera, const Eigen::Isometry3d& pose, std::uint64_t count) {
  Pair pair{std::vector<std::uint8_t>(camera.pixels()), std::vector<std::uint8_t>(camera.pixels())};
  camera.capture(pose, count, pair.left, pair.right);
  return pair;
}

TEST(StereoCamera, IsThePairOfThePapersExperiment) {
  const StereoOptions options;
  EXPECT_EQ(options.camera.width, 752);
  EXPECT_EQ(options.camera.height, 480);
  EXPECT_EQ(options.camera.fx, 448);
  EXPECT_EQ(options.camera.fy, 448);
  EXPECT_EQ(options.baseline_m, 0.1);
  EXPECT_TRUE(options.valid());
}

TEST(StereoCamera, AFlatWallIsShiftedByItsDisparity) {
  StereoOptions options = small_camera();
  options.noise_sigma = 0;
  const StereoCamera camera(std::make_shared<Renderer>(World{}), options);
  // The wall x = 2 from x = 0.4 is 1.6 m away: 224 * 0.1 / 1.6 = 14 pixels.
  const Eigen::Isometry3d pose = look_at({0.4, 0, 1.2}, {2, 0, 1.2});
  const auto [left, right] = take(camera, pose, 0);
  double contrast = 0;
  for (int v = 0; v < 240; ++v) {
    for (int u = 14; u < 376; ++u) {
      const auto i = static_cast<std::size_t>(v * 376 + u);
      ASSERT_NEAR(left[i], right[i - 14], 1) << u << " " << v;
      contrast = std::max(contrast, std::abs(static_cast<double>(left[i]) - right[i]));
    }
  }
  EXPECT_GT(contrast, 50);
}

TEST(StereoCamera, ExactDepthFindsTheCorrespondence) {
  const StereoOptions options = small_camera();
  const Renderer renderer(world_with_box());
  const Eigen::Isometry3d pose = look_at({0.45, 0.3, 0.35}, {0, 0, 0.1});
  const Eigen::Isometry3d right_pose = pose * Eigen::Translation3d(0.1, 0, 0);
  std::vector<float> left, right, depth_m, right_depth;
  renderer.render(options.camera, pose, &left);
  renderer.render(options.camera, right_pose, &right);
  renderer.depth(options.camera, pose, &depth_m);
  renderer.depth(options.camera, right_pose, &right_depth);
  std::vector<double> matched, shifted;
  for (int v = 0; v < 240; ++v) {
    for (int u = 0; u < 376; ++u) {
      const auto row = static_cast<std::size_t>(v * 376);
      const double depth = static_cast<double>(depth_m[row + static_cast<std::size_t>(u)]);
      const double at = u - 224 * 0.1 / depth;
      const int k = static_cast<int>(std::floor(at));
      if (k < 0 || k + 4 >= 376) continue;
      const auto j = row + static_cast<std::size_t>(k);
      // Seen by the right eye, too, and no edge there.
      if (std::abs(static_cast<double>(right_depth[j]) - depth) > 0.02 ||
          std::abs(static_cast<double>(right_depth[j + 1]) - depth) > 0.02) {
        continue;
      }
      const double t = at - k;
      const auto between = [&](std::size_t i) {
        return (1 - t) * static_cast<double>(right[i]) + t * static_cast<double>(right[i + 1]);
      };
      const double here = static_cast<double>(left[row + static_cast<std::size_t>(u)]);
      matched.push_back(std::abs(here - between(j)));
      shifted.push_back(std::abs(here - between(j + 3)));
    }
  }
  ASSERT_GT(matched.size(), 40000U);
  const auto median = [](std::vector<double>& values) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
  };
  // What is left at the right place is the interpolation between pixels.
  EXPECT_LT(median(matched), 0.025);
  EXPECT_GT(median(shifted), 4 * median(matched));
}

TEST(StereoCamera, SameSeedPoseAndCountGiveTheSameBytes) {
  StereoOptions options = small_camera();
  const auto world = world_with_box();
  const Eigen::Isometry3d pose = look_at({0.6, 0, 0.35}, {0, 0, 0.1});
  const StereoCamera camera(std::make_shared<Renderer>(world, 1), options);
  const Pair first = take(camera, pose, 3);
  EXPECT_EQ(take(camera, pose, 3), first);
  EXPECT_EQ(take(StereoCamera(std::make_shared<Renderer>(world, 5), options), pose, 3), first);
  EXPECT_NE(take(camera, pose, 4).left, first.left);
  EXPECT_NE(take(camera, pose, 4).right, first.right);
  options.seed = 2;
  EXPECT_NE(take(StereoCamera(std::make_shared<Renderer>(world), options), pose, 3).left, first.left);
}

TEST(StereoCamera, TwoPicturesOfOnePlaceDifferByTheNoise) {
  const StereoCamera camera(std::make_shared<Renderer>(world_with_box()), small_camera());
  const Eigen::Isometry3d pose = look_at({0.6, 0, 0.35}, {0, 0, 0.1});
  const Pair a = take(camera, pose, 1), b = take(camera, pose, 2);
  double squares = 0;
  int counted = 0;
  for (std::size_t i = 0; i < a.left.size(); ++i) {
    if (a.left[i] < 15 || a.left[i] > 240) continue;  // clipped noise
    squares += (a.left[i] - b.left[i]) * (a.left[i] - b.left[i]);
    ++counted;
  }
  // Two independent noises of sigma 2, each rounded.
  EXPECT_NEAR(std::sqrt(squares / counted), std::sqrt(2 * (4 + 1.0 / 12)), 0.05);
}

TEST(StereoCamera, RefusesBadPosesBuffersAndOptions) {
  const auto renderer = std::make_shared<Renderer>(World{});
  const StereoCamera camera(renderer, small_camera());
  std::vector<std::uint8_t> image(camera.pixels()), shorter(camera.pixels() - 1);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  EXPECT_THROW(camera.capture(pose, 1, image, shorter), std::invalid_argument);
  pose.translation().x() = std::nan("");
  EXPECT_THROW(camera.capture(pose, 1, image, image), std::invalid_argument);
  for (const auto& spoil :
       {+[](StereoOptions* o) { o->noise_sigma = -1; }, +[](StereoOptions* o) { o->exposure_s = 0; },
        +[](StereoOptions* o) { o->baseline_m = std::nan(""); }, +[](StereoOptions* o) { o->camera.width = 0; }}) {
    StereoOptions options = small_camera();
    spoil(&options);
    std::string why;
    EXPECT_FALSE(options.valid(&why));
    EXPECT_FALSE(why.empty());
    EXPECT_THROW(StereoCamera(renderer, options), std::invalid_argument);
  }
}

}  // namespace
}  // namespace vantage::sim
