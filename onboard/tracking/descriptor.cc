#include "onboard/tracking/descriptor.h"

#include <bit>
#include <cmath>
#include <random>

namespace vantage::tracking {
namespace {

constexpr int kReach = 10;    // px: comparisons lie within this of the centre
constexpr int kCentroid = 9;  // px: radius of the disc whose centroid gives the direction
constexpr int kBorder = 17;   // px: the reach on the diagonal, and the smoothing

struct Comparison {
  float ax, ay, bx, by;
};

/// Isotropic Gaussian of a fifth of the patch's side (Calonder's best), clipped. std::mt19937 gives the same numbers
/// everywhere; std::normal_distribution does not promise to, hence the sum of twelve.
std::array<Comparison, 256> make_pattern() {
  std::mt19937 random(20);
  const auto gaussian = [&random] {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random()) / 4294967296.0;
    return static_cast<float>(std::min<double>(kReach, std::max<double>(-kReach, sum * 2 * kReach / 5.0)));
  };
  std::array<Comparison, 256> pattern{};
  for (Comparison& c : pattern) {
    c.ax = gaussian();
    c.ay = gaussian();
    c.bx = gaussian();
    c.by = gaussian();
  }
  return pattern;
}

/// Sum over 5 x 5 pixels.
int smoothed(const ImageView& image, int u, int v) {
  int sum = 0;
  for (int y = -2; y <= 2; ++y) {
    const std::uint8_t* p = image.row(v + y) + u;
    sum += p[-2] + p[-1] + p[0] + p[1] + p[2];
  }
  return sum;
}

}  // namespace

bool describe(const ImageView& image, double u, double v, Descriptor* descriptor) {
  static const std::array<Comparison, 256> kPattern = make_pattern();
  if (!image.inside(u, v, kBorder)) return false;
  const int iu = static_cast<int>(std::lround(u)), iv = static_cast<int>(std::lround(v));
  int mx = 0, my = 0;
  for (int y = -kCentroid; y <= kCentroid; ++y) {
    const std::uint8_t* p = image.row(iv + y) + iu;
    const int width = static_cast<int>(std::sqrt(kCentroid * kCentroid - y * y));
    for (int x = -width; x <= width; ++x) {
      mx += x * p[x];
      my += y * p[x];
    }
  }
  const float length =
      std::sqrt(static_cast<float>(mx) * static_cast<float>(mx) + static_cast<float>(my) * static_cast<float>(my));
  const float c = length > 0 ? static_cast<float>(mx) / length : 1,
              s = length > 0 ? static_cast<float>(my) / length : 0;
  const auto grey = [&](float x, float y) {
    return smoothed(image, iu + static_cast<int>(std::lround(c * x - s * y)),
                    iv + static_cast<int>(std::lround(s * x + c * y)));
  };
  descriptor->fill(0);
  for (std::size_t i = 0; i < kPattern.size(); ++i) {
    const Comparison& k = kPattern[i];
    if (grey(k.ax, k.ay) < grey(k.bx, k.by)) (*descriptor)[i / 64] |= std::uint64_t{1} << (i % 64);
  }
  return true;
}

int hamming_distance(const Descriptor& a, const Descriptor& b) {
  int distance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) distance += std::popcount(a[i] ^ b[i]);
  return distance;
}

}  // namespace vantage::tracking
