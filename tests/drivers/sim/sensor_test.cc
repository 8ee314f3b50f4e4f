#include "drivers/sim/sensor.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace vantage::sim {
namespace {

constexpr std::size_t kPixels = 752 * 480;

std::vector<std::uint8_t> picture(float radiance, double exposure_s, double sigma, std::uint64_t key) {
  const std::vector<float> flat(kPixels, radiance);
  std::vector<std::uint8_t> grey(kPixels);
  expose(flat, exposure_s, sigma, key, grey);
  return grey;
}

TEST(Sensor, NoiseHasTheRequestedStandardDeviationAndNoBias) {
  for (const double sigma : {1.0, 2.0, 5.0}) {
    const double level = 100.3;
    const auto grey = picture(static_cast<float>(level / 255), kReferenceExposure_s, sigma, 42);
    double sum = 0, squares = 0;
    for (const std::uint8_t g : grey) {
      sum += g;
      squares += (g - level) * (g - level);
    }
    const double n = static_cast<double>(kPixels);
    // Rounding adds the variance of a uniform distribution, 1/12. Bounds: five standard errors.
    const double expected = std::sqrt(sigma * sigma + 1.0 / 12);
    EXPECT_NEAR(sum / n, level, 5 * expected / std::sqrt(n));
    EXPECT_NEAR(std::sqrt(squares / n), expected, 5 * expected / std::sqrt(2 * n));
  }
}

TEST(Sensor, NoiseIsGaussian) {
  const auto grey = picture(100.5F / 255, kReferenceExposure_s, 10, 7);
  // 68.3 %, 95.4 % and 99.73 % lie within one, two, three sigma; the limits are where grey levels are cut.
  for (const auto& [sigmas, share] : {std::pair{1, 0.6827}, {2, 0.9545}, {3, 0.9973}}) {
    int inside = 0;
    for (const std::uint8_t g : grey) inside += g > 100 - 10 * sigmas && g <= 100 + 10 * sigmas;
    EXPECT_NEAR(inside / static_cast<double>(kPixels), share, 0.005);
  }
}

TEST(Sensor, NoiseOfNeighboursAndOfOtherKeysIsIndependent) {
  const auto correlation = [](const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b, std::size_t lag) {
    double sum = 0;
    for (std::size_t i = 0; i + lag < kPixels; ++i) sum += (a[i] - 100.0) * (b[i + lag] - 100.0);
    return sum / static_cast<double>(kPixels) / (4 + 1.0 / 12);
  };
  const auto of = [](std::uint64_t key) { return picture(100.0F / 255, kReferenceExposure_s, 2, key); };
  const auto grey = of(noise_key(1, 1, 0));
  for (const std::size_t lag : {1U, 2U, 3U, 751U, 752U, 753U}) EXPECT_LT(std::abs(correlation(grey, grey, lag)), 0.01);
  for (const std::uint64_t key : {noise_key(1, 1, 1), noise_key(1, 2, 0), noise_key(2, 1, 0)}) {
    for (const std::size_t lag : {0U, 1U, 2U}) EXPECT_LT(std::abs(correlation(grey, of(key), lag)), 0.01);
  }
  EXPECT_EQ(grey, of(noise_key(1, 1, 0)));
}

TEST(Sensor, GreyIsProportionalToExposureUntilItSaturates) {
  for (const double exposure_s : {0.0025, 0.005, 0.010, 0.020, 0.030}) {
    EXPECT_EQ(picture(0.3F, exposure_s, 0, 1)[0], std::lround(255 * 0.3 * exposure_s / 0.010)) << exposure_s;
  }
  EXPECT_EQ(picture(0.3F, 0.1, 0, 1)[0], 255);
  for (const std::uint8_t g : picture(0, 0.010, 0, 1)) ASSERT_EQ(g, 0);
}

TEST(Sensor, RefusesImagesOfDifferentSize) {
  const std::vector<float> radiance(4);
  std::vector<std::uint8_t> grey(3);
  EXPECT_THROW(expose(radiance, 0.01, 0, 1, grey), std::invalid_argument);
}

}  // namespace
}  // namespace vantage::sim
