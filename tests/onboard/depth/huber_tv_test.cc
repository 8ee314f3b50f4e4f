#include "onboard/depth/huber_tv.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/onboard/depth/plane_scene.h"

namespace vantage {
namespace {

constexpr int kWidth = 120, kHeight = 80;

/// A map whose inverse depth is `truth(x, y)` plus noise of relative sigma `noise`, all converged; grey as `grey` says.
struct Case {
  DepthMap map;
  GreyImage image;
  std::vector<double> truth;
};

template <typename Truth, typename Grey>
Case make_case(Truth&& truth, Grey&& grey, double noise) {
  Case c;
  c.map.camera = {.width = kWidth, .height = kHeight, .fx = 100, .fy = 100, .cx = 60, .cy = 40, .coefficients = {}};
  auto pixels = std::make_shared<std::vector<std::uint8_t>>();
  std::mt19937 random(9);
  std::normal_distribution<double> normal(0, 1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double inverse = truth(x, y);
      c.truth.push_back(inverse);
      const double measured = inverse * (1 + noise * normal(random));
      c.map.depth_m.push_back(static_cast<float>(1 / measured));
      c.map.sigma_m.push_back(static_cast<float>(std::max(noise, 1e-4) / measured));
      c.map.state.push_back(DepthState::kConverged);
      pixels->push_back(static_cast<std::uint8_t>(grey(x, y)));
    }
  }
  c.image = {.width = kWidth,
             .height = kHeight,
             .stride = kWidth,
             .pixels = std::shared_ptr<const std::uint8_t>(pixels, pixels->data())};
  return c;
}

double rms_relative(const Case& c) {
  double sum = 0;
  for (std::size_t i = 0; i < c.truth.size(); ++i) {
    const double off = 1 / (c.map.depth_m[i] * c.truth[i]) - 1;
    sum += off * off;
  }
  return std::sqrt(sum / static_cast<double>(c.truth.size()));
}

double slope(int x, int) { return 1 + 0.004 * x; }
int flat_grey(int, int) { return 100; }

TEST(HuberTvTest, TakesNoiseOffASlope) {
  Case c = make_case(slope, flat_grey, 0.01);
  const double before = rms_relative(c);
  WorkerPool pool(2);
  HuberTvSmoother smoother(kWidth, kHeight, {}, &pool);
  smoother.smooth(c.image, &c.map);
  EXPECT_LT(rms_relative(c), 0.5 * before);
}

TEST(HuberTvTest, LeavesASlopeWithoutNoiseASlope) {
  Case c = make_case(slope, flat_grey, 0);
  WorkerPool pool(2);
  HuberTvSmoother smoother(kWidth, kHeight, {}, &pool);
  smoother.smooth(c.image, &c.map);
  EXPECT_LT(rms_relative(c), 1e-3);
}

TEST(HuberTvTest, KeepsAStepWhereTheImageHasAnEdge) {
  const auto step = [](int x, int) { return x < 60 ? 1.0 : 2.0; };
  const auto grey = [](int x, int) { return x < 60 ? 40 : 200; };
  Case c = make_case(step, grey, 0.01);
  WorkerPool pool(2);
  HuberTvSmoother smoother(kWidth, kHeight, {}, &pool);
  smoother.smooth(c.image, &c.map);
  for (int y = 10; y < 70; ++y) {
    const std::size_t row = static_cast<std::size_t>(y * kWidth);
    EXPECT_NEAR(1 / c.map.depth_m[row + 58], 1, 0.02);
    EXPECT_NEAR(1 / c.map.depth_m[row + 61], 2, 0.04);
  }
}

TEST(HuberTvTest, MovesAnUnsurePixelAndKeepsASureOne) {
  // One pixel in a hundred is half as much again. Where its sigma says that this may be wrong it follows its
  // neighbours; where it is as sure as they are it gives way by four times the gradient's weight, what four neighbours
  // can pull.
  const auto moved_by = [](double relative_sigma) {
    Case c = make_case([](int, int) { return 1.0; }, flat_grey, 0.002);
    std::vector<std::size_t> odd;
    for (int y = 5; y < kHeight; y += 10) {
      for (int x = 5; x < kWidth; x += 10) odd.push_back(static_cast<std::size_t>(y * kWidth + x));
    }
    for (const std::size_t i : odd) {
      c.map.depth_m[i] = static_cast<float>(1 / 1.5);
      c.map.sigma_m[i] = static_cast<float>(relative_sigma / 1.5);
    }
    WorkerPool pool(1);
    HuberTvSmoother(kWidth, kHeight, {}, &pool).smooth(c.image, &c.map);
    double sum = 0;
    for (const std::size_t i : odd) sum += std::abs(1 / c.map.depth_m[i] - 1.5);
    return sum / static_cast<double>(odd.size());
  };
  EXPECT_GT(moved_by(0.05), 0.45);
  EXPECT_LT(moved_by(0.002), 4 * SmoothingOptions{}.strength + 0.01);
}

TEST(HuberTvTest, LeavesPixelsThatHaveNotConverged) {
  Case c = make_case(slope, flat_grey, 0.01);
  for (std::size_t i = 0; i < c.map.state.size(); i += 3) {
    c.map.state[i] = DepthState::kUpdating;
    c.map.depth_m[i] = 9;
  }
  WorkerPool pool(2);
  HuberTvSmoother(kWidth, kHeight, {}, &pool).smooth(c.image, &c.map);
  for (std::size_t i = 0; i < c.map.state.size(); i += 3) EXPECT_EQ(c.map.depth_m[i], 9);
}

TEST(HuberTvTest, IsThereAfterSoManyIterations) {
  Case few = make_case(slope, flat_grey, 0.01), many = few;
  WorkerPool pool(2);
  HuberTvSmoother usual(kWidth, kHeight, {}, &pool);
  usual.smooth(few.image, &few.map);
  SmoothingOptions long_run;
  long_run.iterations = 3000;
  HuberTvSmoother thorough(kWidth, kHeight, long_run, &pool);
  thorough.smooth(many.image, &many.map);
  EXPECT_LT(usual.energy(), 1.01 * thorough.energy());
  EXPECT_GE(usual.energy(), 0.999 * thorough.energy());
}

TEST(HuberTvTest, DoesNotDependOnTheThreads) {
  Case a = make_case(slope, flat_grey, 0.01), b = a;
  WorkerPool one(1), three(3);
  HuberTvSmoother(kWidth, kHeight, {}, &one).smooth(a.image, &a.map);
  HuberTvSmoother(kWidth, kHeight, {}, &three).smooth(b.image, &b.map);
  EXPECT_EQ(a.map.depth_m, b.map.depth_m);
}

}  // namespace
}  // namespace vantage
