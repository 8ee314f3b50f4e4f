#include "drivers/sim/texture.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace vantage::sim {
namespace {

float texture_at(double x, double y, double z, double footprint_m, std::uint32_t seed) {
  const auto splat = [](double value) {
    const auto v = static_cast<float>(value);
    return Float4{v, v, v, v};
  };
  return solid_texture(splat(x), splat(y), splat(z), splat(footprint_m), seed)[0];
}

/// The pattern on a plane as a camera with one pixel a footprint sees it.
std::vector<double> patch(int width, int height, double footprint_m, std::uint32_t seed) {
  std::vector<double> values;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      values.push_back(
          static_cast<double>(texture_at(u * footprint_m - 0.7, v * footprint_m - 0.4, 0, footprint_m, seed)));
    }
  }
  return values;
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const double mean_a = mean(a), mean_b = mean(b);
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
  }
  return ab / std::sqrt(aa * bb);
}

/// What a block matcher of 15 pixels sees: the local mean of every row taken away.
std::vector<double> without_local_mean(const std::vector<double>& values, int width) {
  constexpr int kHalf = 7;
  std::vector<double> result(values.size());
  const auto rows = static_cast<int>(values.size()) / width;
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < width; ++u) {
      double sum = 0;
      int count = 0;
      for (int k = std::max(0, u - kHalf); k <= std::min(width - 1, u + kHalf); ++k, ++count) {
        sum += values[static_cast<std::size_t>(v * width + k)];
      }
      result[static_cast<std::size_t>(v * width + u)] = values[static_cast<std::size_t>(v * width + u)] - sum / count;
    }
  }
  return result;
}

/// Footprints (m a pixel) of f = 448 px at 0.4, 0.6, 1, 1.6 and 3 m.
constexpr double kFootprints[] = {0.4 / 448, 0.6 / 448, 1.0 / 448, 1.6 / 448, 3.0 / 448};

TEST(Texture, DoesNotRepeatInsideTheDisparityRange) {
  constexpr int kWidth = 400, kHeight = 200;
  for (const double footprint_m : kFootprints) {
    const std::vector<double> values = without_local_mean(patch(kWidth, kHeight, footprint_m, 5), kWidth);
    for (int lag = 16; lag <= 128; ++lag) {
      std::vector<double> here, there;
      for (int v = 0; v < kHeight; ++v) {
        for (int u = 0; u + lag < kWidth; ++u) {
          here.push_back(values[static_cast<std::size_t>(v * kWidth + u)]);
          there.push_back(values[static_cast<std::size_t>(v * kWidth + u + lag)]);
        }
      }
      // A pattern with this period would have 1; independent patches of 50,000 pixels stay below 0.05.
      EXPECT_LT(std::abs(correlation(here, there)), 0.08) << "lag " << lag << ", footprint " << footprint_m;
    }
  }
}

TEST(Texture, HasContrastForBlockMatchingAtEveryDistance) {
  for (const double footprint_m : kFootprints) {
    const std::vector<double> values = without_local_mean(patch(200, 100, footprint_m, 5), 200);
    double sum = 0;
    for (const double value : values) sum += value * value;
    // Ten times the sensor's noise (2 of 255) on a fully lit surface.
    EXPECT_GT(std::sqrt(sum / static_cast<double>(values.size())), 10 * 2.0 / 255) << footprint_m;
  }
}

TEST(Texture, SurfacesOfDifferentSeedsAreUnrelated) {
  EXPECT_LT(std::abs(correlation(patch(300, 200, 0.003, 1), patch(300, 200, 0.003, 2))), 0.05);
  EXPECT_EQ(patch(50, 20, 0.003, 1), patch(50, 20, 0.003, 1));
}

TEST(Texture, IsContinuousAcrossLatticeCellsAndZero) {
  // The steepest octave changes by at most 2 * 1.5 * amplitude over a cell of 2.5 mm; all octaves together stay
  // below 0.001 over a micrometre.
  for (const double at : {-0.0025, 0.0, 0.006, 0.033, -0.08, 1.2345}) {
    EXPECT_NEAR(texture_at(at - 5e-7, 0.1, 0.2, 0.0005, 3), texture_at(at + 5e-7, 0.1, 0.2, 0.0005, 3), 0.001) << at;
  }
}

TEST(Texture, StaysAReflectance) {
  for (const double value : patch(400, 300, 0.001, 9)) {
    ASSERT_GE(value, 0.04 - 1e-6);
    ASSERT_LE(value, 0.96 + 1e-6);
  }
}

}  // namespace
}  // namespace vantage::sim
