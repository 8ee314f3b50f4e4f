#include "onboard/depth/depth_filter.h"

#include <cmath>
#include <limits>
#include <memory>

#include <gtest/gtest.h>

#include "onboard/depth/cpu_depth_backend.h"
#include "onboard/depth/depth_figures.h"
#include "tests/allocation_watch.h"
#include "tests/onboard/depth/malloc_watch.h"
#include "tests/onboard/depth/plane_scene.h"

namespace vantage {
namespace {

/// A wall 1.2 m away that falls away to one side, and a board half a metre before it.
PlaneScene wall_and_board() {
  PlaneScene scene;
  scene.rectangles = {{.z = 1.2, .grain_m = 0.03, .slope = 0.2, .seed = 1},
                      {.z = 0.7, .centre = {-0.1, 0}, .half = {0.12, 0.1}, .grain_m = 0.02, .seed = 2}};
  return scene;
}

/// A camera that hovers: +-4 cm to the sides, +-1 cm ahead, +-1 degree.
Eigen::Isometry3d hover(int i) {
  return camera_at(0.04 * std::sin(0.35 * i), 0.04 * std::sin(0.23 * i), 0.01 * std::sin(0.19 * i),
                   0.017 * std::sin(0.27 * i));
}

struct Rig {
  CameraModel camera = small_camera();
  WorkerPool pool{2};
  DepthFilterOptions options;
  std::unique_ptr<DepthFilter> filter;

  explicit Rig(bool refine = false, int threads = 2) : pool(threads) {
    options.min_depth_m = 0.4;
    options.max_depth_m = 4;
    options.refine_poses = refine;
    make();
  }
  void make() {
    filter = std::make_unique<DepthFilter>(
        camera, options, KeyFrameOptions{},
        std::make_unique<CpuDepthBackend>(camera.width, camera.height, options, &pool), &pool);
  }

  int count(PixelState state) const {
    std::vector<PixelBelief> beliefs;
    std::vector<PixelState> states;
    filter->read(&beliefs, &states);
    return static_cast<int>(std::count(states.begin(), states.end(), state));
  }
};

/// Starts with the camera at hover(0) and takes `frames` more.
void fly(Rig& rig, const PlaneScene& scene, int frames) {
  ASSERT_EQ(rig.filter->start(posed(0, photograph(scene, rig.camera, hover(0), 1), hover(0))), FrameUse::kUsed);
  for (int i = 1; i <= frames; ++i) {
    const GreyImage image = photograph(scene, rig.camera, hover(i), static_cast<std::uint64_t>(i + 1));
    ASSERT_EQ(rig.filter->update(posed(i, image, hover(i))), FrameUse::kUsed);
  }
}

TEST(DepthFilterTest, FindsTheDepthOfPlanes) {
  Rig rig;
  const PlaneScene scene = wall_and_board();
  fly(rig, scene, 30);
  const DepthMap map = rig.filter->depth_map();
  std::string why;
  EXPECT_TRUE(map.valid(&why)) << why;
  const DepthFigures figures = depth_figures(map, true_depth(scene, rig.camera, hover(0)));
  EXPECT_GT(figures.completeness_5, 0.70);  // border and what leaves the image are a fifth of this small one
  EXPECT_GT(figures.precision_5, 0.97);
  EXPECT_LT(figures.median_rel_error, 0.004);
}

TEST(DepthFilterTest, StatesAreWhatTheySay) {
  Rig rig;
  fly(rig, wall_and_board(), 30);
  const int width = rig.camera.width, height = rig.camera.height;
  EXPECT_EQ(rig.count(PixelState::kBorder), width * height - (width - 2 * kBorder) * (height - 2 * kBorder));
  EXPECT_EQ(rig.count(PixelState::kNoTexture), 0);
  int all = 0;
  for (const int pixels : rig.filter->counts().states) all += pixels;
  EXPECT_EQ(all, width * height);
}

TEST(DepthFilterTest, LeavingTheImageIsNoFailedMatch) {
  // The camera turns until half of the wall is out of sight, and stays so.
  Rig rig;
  PlaneScene scene;
  scene.rectangles = {{.z = 1.2, .grain_m = 0.03}};
  for (int i = 0; i <= 60; ++i) {
    const Eigen::Isometry3d pose =
        camera_at(0.03 * std::sin(0.35 * i), 0.02 * std::sin(0.23 * i), 0, std::min(0.01 * i, 0.45));
    const GreyImage image = photograph(scene, rig.camera, pose, static_cast<std::uint64_t>(i + 1));
    ASSERT_EQ(i == 0 ? rig.filter->start(posed(0, image, pose)) : rig.filter->update(posed(i, image, pose)),
              FrameUse::kUsed);
  }
  EXPECT_GT(rig.count(PixelState::kNotVisible), 1000);
  EXPECT_LT(rig.count(PixelState::kDiverged), 100);
}

TEST(DepthFilterTest, SigmaIsAsLargeAsTheError) {
  Rig rig;
  const PlaneScene scene = wall_and_board();
  fly(rig, scene, 30);
  const DepthMap map = rig.filter->depth_map();
  const std::vector<float> truth = true_depth(scene, rig.camera, hover(0));
  int within_three = 0, converged = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (map.state[i] != DepthState::kConverged) continue;
    ++converged;
    within_three += std::abs(map.depth_m[i] - truth[i]) < 3 * map.sigma_m[i] ? 1 : 0;
  }
  EXPECT_GT(within_three, 0.9 * converged);
}

TEST(DepthFilterTest, ResultDoesNotDependOnTheThreads) {
  Rig one(false, 1), three(false, 3);
  fly(one, wall_and_board(), 8);
  fly(three, wall_and_board(), 8);
  EXPECT_EQ(one.filter->depth_map().depth_m, three.filter->depth_map().depth_m);
}

TEST(DepthFilterTest, ConvergesAlikeAtAnyScale) {
  // The same images; poses and depths in a unit a hundred times as short.
  Rig metres, other;
  other.options.min_depth_m *= 100;
  other.options.max_depth_m *= 100;
  other.make();
  const PlaneScene scene = wall_and_board();
  for (int i = 0; i <= 20; ++i) {
    const GreyImage image = photograph(scene, metres.camera, hover(i), static_cast<std::uint64_t>(i + 1));
    PosedImage frame = posed(i, image, hover(i)), scaled = frame;
    scaled.T_world_camera.translation() *= 100;
    ASSERT_EQ(i == 0 ? metres.filter->start(frame) : metres.filter->update(frame), FrameUse::kUsed);
    ASSERT_EQ(i == 0 ? other.filter->start(scaled) : other.filter->update(scaled), FrameUse::kUsed);
  }
  EXPECT_NEAR(metres.count(PixelState::kConverged), other.count(PixelState::kConverged),
              0.005 * metres.count(PixelState::kConverged));
}

TEST(DepthFilterTest, PureRotationConvergesNothingAndClaimsNothing) {
  for (const bool refine : {false, true}) {
    Rig rig(refine);
    const PlaneScene scene = wall_and_board();
    for (int i = 0; i <= 30; ++i) {
      const Eigen::Isometry3d pose = camera_at(0, 0, 0, 0.05 * std::sin(0.3 * i));
      PosedImage frame = posed(i, photograph(scene, rig.camera, pose, static_cast<std::uint64_t>(i)), pose);
      frame.covariance.diagonal().setConstant(1e-8);
      ASSERT_EQ(i == 0 ? rig.filter->start(frame) : rig.filter->update(frame), FrameUse::kUsed);
    }
    const DepthMap map = rig.filter->depth_map();
    EXPECT_EQ(std::count(map.state.begin(), map.state.end(), DepthState::kConverged), 0);
    EXPECT_EQ(std::count(map.state.begin(), map.state.end(), DepthState::kDiverged), 0);
  }
}

TEST(DepthFilterTest, AWallWithoutTextureSaysSo) {
  Rig rig;
  PlaneScene scene;
  scene.rectangles = {{.z = 1, .contrast = 0}};
  fly(rig, scene, 20);
  EXPECT_EQ(rig.count(PixelState::kConverged), 0);
  // Noise may look like a gradient to a pixel here and there.
  const int inner = (rig.camera.width - 2 * kBorder) * (rig.camera.height - 2 * kBorder);
  EXPECT_GT(rig.count(PixelState::kNoTexture), 0.99 * inner);
}

TEST(DepthFilterTest, AMovingObjectEndsDiverged) {
  Rig rig;
  PlaneScene scene = wall_and_board();
  const PlaneScene still = scene;
  ASSERT_EQ(rig.filter->start(posed(0, photograph(scene, rig.camera, hover(0), 1), hover(0))), FrameUse::kUsed);
  for (int i = 1; i <= 60; ++i) {
    scene.rectangles[1].centre.y() = 0.02 * i;  // the board is carried away, across all epipolar lines
    const GreyImage image = photograph(scene, rig.camera, hover(i), static_cast<std::uint64_t>(i + 1));
    ASSERT_EQ(rig.filter->update(posed(i, image, hover(i))), FrameUse::kUsed);
  }
  std::vector<PixelBelief> beliefs;
  std::vector<PixelState> states;
  rig.filter->read(&beliefs, &states);
  const std::vector<float> truth = true_depth(still, rig.camera, hover(0));
  int board = 0, diverged = 0, converged = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (truth[i] > 0.75F || states[i] == PixelState::kBorder) continue;
    ++board;
    diverged += states[i] == PixelState::kDiverged ? 1 : 0;
    converged += states[i] == PixelState::kConverged ? 1 : 0;
  }
  EXPECT_GT(diverged, 0.8 * board);
  EXPECT_LT(converged, 0.05 * board);
}

TEST(DepthFilterTest, BlurredRepeatedAndBrighterFramesDoNoHarm) {
  const PlaneScene scene = wall_and_board();
  Rig rig;
  ASSERT_EQ(rig.filter->start(posed(0, photograph(scene, rig.camera, hover(0), 1), hover(0))), FrameUse::kUsed);
  std::int64_t number = 0;
  for (int i = 1; i <= 30; ++i) {
    const bool brighter = i % 4 == 1;
    GreyImage image = photograph(scene, rig.camera, hover(i), static_cast<std::uint64_t>(i + 1), 1, brighter ? 1.2 : 1,
                                 brighter ? 12 : 0);
    if (i % 4 == 2) {
      // A blur of nine pixels along x.
      auto blurred = std::make_shared<std::vector<std::uint8_t>>(image.pixels.get(),
                                                                 image.pixels.get() + image.width * image.height);
      for (int y = 0; y < image.height; ++y) {
        for (int x = 4; x + 4 < image.width; ++x) {
          int sum = 0;
          for (int k = -4; k <= 4; ++k) sum += image.pixels.get()[y * image.stride + x + k];
          (*blurred)[static_cast<std::size_t>(y * image.width + x)] = static_cast<std::uint8_t>(sum / 9);
        }
      }
      image.pixels = std::shared_ptr<const std::uint8_t>(blurred, blurred->data());
    }
    ASSERT_EQ(rig.filter->update(posed(++number, image, hover(i))), FrameUse::kUsed);
    if (i % 4 == 3) {
      // The same frame again, later: five times what was already known.
      for (int k = 0; k < 5; ++k) ASSERT_EQ(rig.filter->update(posed(++number, image, hover(i))), FrameUse::kUsed);
    }
  }
  const DepthFigures figures = depth_figures(rig.filter->depth_map(), true_depth(scene, rig.camera, hover(0)));
  EXPECT_GT(figures.completeness_5, 0.65);
  EXPECT_GT(figures.precision_5, 0.95);
}

TEST(DepthFilterTest, PoseNoiseSlowsConvergenceAndDoesNotFalsifyIt) {
  // 5 mm on every axis of every pose, the key frame's too, as stated; with the poses mended and with them as given.
  constexpr unsigned kSeed = 3;
  SCOPED_TRACE(testing::Message() << "seed " << kSeed);
  const PlaneScene scene = wall_and_board();
  for (const bool refine : {true, false}) {
    std::mt19937 random(kSeed);
    std::normal_distribution<double> normal(0, 0.005);
    Rig rig(refine);
    for (int i = 0; i <= 45; ++i) {
      PosedImage frame = posed(i, photograph(scene, rig.camera, hover(i), static_cast<std::uint64_t>(i + 1)), hover(i));
      for (int k = 0; k < 3; ++k) frame.T_world_camera.translation()(k) += normal(random);
      frame.covariance.topLeftCorner<3, 3>().diagonal().setConstant(0.005 * 0.005);
      frame.covariance.bottomRightCorner<3, 3>().diagonal().setConstant(1e-6);
      ASSERT_EQ(i == 0 ? rig.filter->start(frame) : rig.filter->update(frame), FrameUse::kUsed);
    }
    const DepthFigures figures = depth_figures(rig.filter->depth_map(), true_depth(scene, rig.camera, hover(0)));
    if (refine) {
      EXPECT_GT(figures.converged, 0.5);
      EXPECT_GT(figures.precision_5, 0.9);
    } else if (figures.converged > 0.01) {
      EXPECT_GT(figures.precision_5, 0.9);
    }
  }
}

TEST(DepthFilterTest, CarriesTheBeliefToTheNextKeyFrame) {
  for (const bool refine : {false, true}) {
    Rig rig(refine);
    const PlaneScene scene = wall_and_board();
    fly(rig, scene, 30);
    const double before = depth_figures(rig.filter->depth_map(), true_depth(scene, rig.camera, hover(0))).converged;
    const PosedImage next = posed(30, photograph(scene, rig.camera, hover(30), 31), hover(30));
    ASSERT_EQ(rig.filter->advance(next), FrameUse::kUsed);
    // Much is there at once, and right, though less sure.
    const std::vector<float> truth = true_depth(scene, rig.camera, hover(30));
    const DepthMap carried = rig.filter->depth_map();
    int known = 0, right = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (carried.state[i] != DepthState::kUpdating) continue;
      ++known;
      right += std::abs(carried.depth_m[i] - truth[i]) < 0.05F * truth[i] ? 1 : 0;
    }
    EXPECT_GT(known, 0.7 * before * static_cast<double>(truth.size()));
    EXPECT_GT(right, 0.95 * known);
    for (int i = 31; i <= 38; ++i) {
      const GreyImage image = photograph(scene, rig.camera, hover(i), static_cast<std::uint64_t>(i + 1));
      ASSERT_EQ(rig.filter->update(posed(i, image, hover(i))), FrameUse::kUsed);
    }
    const DepthFigures figures = depth_figures(rig.filter->depth_map(), truth);
    EXPECT_GT(figures.completeness_5, 0.6);
    EXPECT_GT(figures.precision_5, 0.95);
  }
}

TEST(DepthFilterTest, RefusesBadFramesAndStaysAsItWas) {
  Rig rig;
  const PlaneScene scene = wall_and_board();
  const GreyImage image = photograph(scene, rig.camera, hover(0), 1);
  EXPECT_EQ(rig.filter->update(posed(1, image, hover(1))), FrameUse::kNoKeyFrame);
  fly(rig, scene, 5);
  const DepthMap before = rig.filter->depth_map();

  PosedImage frame = posed(6, image, hover(6));
  frame.T_world_camera.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(rig.filter->update(frame), FrameUse::kBadPose);
  frame = posed(6, image, hover(6));
  frame.T_world_camera.linear() *= 1.1;
  EXPECT_EQ(rig.filter->update(frame), FrameUse::kBadPose);
  frame = posed(6, image, hover(6));
  frame.covariance(2, 2) = -1;
  EXPECT_EQ(rig.filter->update(frame), FrameUse::kBadPose);
  frame = posed(6, image, hover(6));
  frame.image.width = 80;
  EXPECT_EQ(rig.filter->update(frame), FrameUse::kWrongSize);
  frame.image = {};
  EXPECT_EQ(rig.filter->update(frame), FrameUse::kWrongSize);
  EXPECT_EQ(rig.filter->update(posed(5, image, hover(6))), FrameUse::kOutOfOrder);
  EXPECT_EQ(rig.filter->update(posed(2, image, hover(6))), FrameUse::kOutOfOrder);

  EXPECT_EQ(rig.filter->refused(), 8U);
  const DepthMap after = rig.filter->depth_map();
  EXPECT_EQ(before.depth_m, after.depth_m);
  EXPECT_EQ(before.sigma_m, after.sigma_m);
  EXPECT_EQ(before.state, after.state);
}

TEST(DepthFilterTest, AFrameTakesNothingFromTheHeap) {
  if (!AllocationWatch::works()) GTEST_SKIP() << "sanitizers replace operator new";
  for (const bool refine : {false, true}) {
    SCOPED_TRACE(testing::Message() << "poses mended " << refine);
    Rig rig(refine, 1);
    const PlaneScene scene = wall_and_board();
    fly(rig, scene, 2);
    std::vector<PosedImage> frames;
    for (int i = 3; i <= 15; ++i) {
      frames.push_back(posed(i, photograph(scene, rig.camera, hover(i), static_cast<std::uint64_t>(i + 1)), hover(i)));
    }
    int used = 0;
    const AllocationWatch watch;
    const MallocWatch malloc_watch;
    for (const PosedImage& frame : frames) used += rig.filter->update(frame) == FrameUse::kUsed ? 1 : 0;
    const std::size_t taken = watch.count() + malloc_watch.count();
    EXPECT_EQ(taken, 0);
    EXPECT_EQ(used, 13);
  }
}

}  // namespace
}  // namespace vantage
