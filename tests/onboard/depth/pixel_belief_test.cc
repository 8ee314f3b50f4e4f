#include "onboard/depth/pixel_belief.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace vantage {
namespace {

struct Moments {
  double mean = 0, variance = 0, ratio = 0, ratio_square = 0;
};

/// The posterior by sums over a dense grid of inverse depth and inlier ratio: the model itself, no approximation.
Moments dense_bayes(const PixelBelief& prior, double measured, double variance, double range) {
  constexpr int kDepths = 2000, kRatios = 400;
  const double sigma = std::sqrt(static_cast<double>(prior.variance));
  double total = 0, m1 = 0, m2 = 0, r1 = 0, r2 = 0;
  for (int i = 0; i < kDepths; ++i) {
    const double z = prior.mean + 8 * sigma * (2 * (i + 0.5) / kDepths - 1);
    const double gauss = std::exp(-0.5 * (z - prior.mean) * (z - prior.mean) / prior.variance);
    const double hit =
        std::exp(-0.5 * (measured - z) * (measured - z) / variance) / std::sqrt(2 * 3.14159265358979 * variance);
    for (int k = 0; k < kRatios; ++k) {
      const double ratio = (k + 0.5) / kRatios;
      const double beta = std::pow(ratio, prior.inliers - 1) * std::pow(1 - ratio, prior.outliers - 1);
      const double weight = gauss * beta * (ratio * hit + (1 - ratio) / range);
      total += weight;
      m1 += weight * z;
      m2 += weight * z * z;
      r1 += weight * ratio;
      r2 += weight * ratio * ratio;
    }
  }
  Moments moments{m1 / total, 0, r1 / total, r2 / total};
  moments.variance = m2 / total - moments.mean * moments.mean;
  return moments;
}

void expect_same(const PixelBelief& prior, double measured, double variance, double range) {
  const PixelBelief next =
      updated_belief(prior, static_cast<float>(measured), static_cast<float>(variance), static_cast<float>(range));
  const Moments truth = dense_bayes(prior, measured, variance, range);
  const double sigma = std::sqrt(static_cast<double>(prior.variance));
  EXPECT_NEAR(next.mean, truth.mean, 2e-3 * sigma);
  EXPECT_NEAR(next.variance, truth.variance, 5e-3 * prior.variance);
  EXPECT_NEAR(next.inlier_ratio(), truth.ratio, 1e-3);
  const double a = next.inliers, b = next.outliers;
  EXPECT_NEAR(a * (a + 1) / ((a + b) * (a + b + 1)), truth.ratio_square, 1e-3);
}

TEST(PixelBeliefTest, IsTheDensePosteriorsMoments) {
  const PixelBelief prior{.mean = 1.5F, .variance = 0.04F, .inliers = 10, .outliers = 10};
  expect_same(prior, 1.6, 0.01, 3);    // agrees
  expect_same(prior, 2.6, 0.01, 3);    // far off: an outlier
  expect_same(prior, 1.9, 0.0004, 3);  // two sigmas off, sharp
}

TEST(PixelBeliefTest, IsTheDensePosteriorsMomentsForAnyBelief) {
  constexpr unsigned kSeed = 5;
  SCOPED_TRACE(testing::Message() << "seed " << kSeed);
  std::mt19937 random(kSeed);
  const auto uniform = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 20; ++i) {
    PixelBelief prior;
    prior.mean = static_cast<float>(uniform(0.3, 3));
    const double sigma = uniform(0.02, 0.3);
    prior.variance = static_cast<float>(sigma * sigma);
    prior.inliers = static_cast<float>(uniform(3, 30));
    prior.outliers = static_cast<float>(uniform(3, 30));
    const double tau = sigma * uniform(0.2, 2);
    expect_same(prior, prior.mean + sigma * uniform(-4, 4), tau * tau, uniform(1, 5));
  }
}

TEST(PixelBeliefTest, AMissIsAnOutlierAndTellsNoDepth) {
  const PixelBelief prior{.mean = 1, .variance = 0.1F, .inliers = 4, .outliers = 6};
  const PixelBelief next = missed_belief(prior);
  EXPECT_EQ(next.mean, prior.mean);
  EXPECT_EQ(next.variance, prior.variance);
  EXPECT_FLOAT_EQ(next.inlier_ratio(), 4.0F / 11.0F);
}

TEST(PixelBeliefTest, ConvergesInDepthAndRatioAtAnyScale) {
  // Eight of ten measurements are right. The same scene in metres and in a unit a hundred times as long.
  for (const double unit : {1.0, 100.0}) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> anywhere(0.1, 3.1);
    const auto scaled = [unit](double value) { return static_cast<float>(value / unit); };
    PixelBelief belief{.mean = scaled(1.6), .variance = scaled(0.75) * scaled(0.75), .inliers = 10, .outliers = 10};
    for (int i = 0; i < 60; ++i) {
      const double measured = i % 5 == 4 ? anywhere(random) : 0.7 + 0.02 * normal(random);
      belief = updated_belief(belief, scaled(measured), scaled(0.02) * scaled(0.02), scaled(3));
    }
    EXPECT_NEAR(belief.mean * unit, 0.7, 0.01);
    EXPECT_LT(std::sqrt(belief.variance) / belief.mean, 0.02);
    EXPECT_NEAR(belief.inlier_ratio(), 0.75, 0.1);
  }
}

}  // namespace
}  // namespace vantage
