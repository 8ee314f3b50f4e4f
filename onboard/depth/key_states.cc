#include "onboard/depth/key_states.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace vantage {
namespace {

constexpr int kHalf = kPatchRows / 2;
constexpr int kSide = 2 * kHalf + 1;

/// Standard deviation of an image's noise, grey levels: by the median of a second difference that no plane of grey
/// passes (Immerkaer, "Fast noise variance estimation", 1996, made robust). Texture makes it too high where it covers
/// more than half of the image.
float estimate_noise(const ImagePyramid::Level& image) {
  std::array<int, 4 * 512> histogram{};
  int count = 0;
  for (int y = 1; y + 1 < image.height; y += 2) {
    const std::uint8_t* row = image.pixels + static_cast<std::ptrdiff_t>(y) * image.stride;
    const std::uint8_t *above = row - image.stride, *below = row + image.stride;
    for (int x = 1; x + 1 < image.width; x += 2) {
      const int corners = above[x - 1] + above[x + 1] + below[x - 1] + below[x + 1];
      const int sides = above[x] + below[x] + row[x - 1] + row[x + 1];
      ++histogram[static_cast<std::size_t>(std::abs(corners - 2 * sides + 4 * row[x]))];
      ++count;
    }
  }
  int below_median = 0;
  std::size_t median = 0;
  while (median + 1 < histogram.size() && 2 * (below_median += histogram[median]) < count) ++median;
  return static_cast<float>(median) / (0.6745F * 6);  // a Gaussian's median of |x|; the weights' norm
}

/// The larger eigenvalue of the structure tensor: the sum of squared gradients along the best direction.
float gradient_energy(const ImagePyramid::Level& image, int x, int y) {
  float xx = 0, xy = 0, yy = 0;
  for (int v = y - kHalf; v <= y + kHalf; ++v) {
    const std::uint8_t* row = image.pixels + static_cast<std::ptrdiff_t>(v) * image.stride + x;
    for (int u = -kHalf; u <= kHalf; ++u) {
      const float gx = 0.5F * static_cast<float>(row[u + 1] - row[u - 1]);
      const float gy = 0.5F * static_cast<float>(row[u + image.stride] - row[u - image.stride]);
      xx += gx * gx;
      xy += gx * gy;
      yy += gy * gy;
    }
  }
  const float mean = 0.5F * (xx + yy), off = 0.5F * (xx - yy);
  return mean + std::sqrt(off * off + xy * xy);
}

}  // namespace

void find_key_states(const ImagePyramid::Level& image, const PixelSettings& settings, std::span<PixelState> states) {
  const float noise = std::min(settings.image_noise, estimate_noise(image));
  // What noise alone makes of the sum of squared gradients, and as much as it takes for the larger eigenvalue of 99 in
  // 100 patches of noise to stay below; then what a match needs.
  const float noise_energy = 2.5F * 0.5F * kSide * kSide * noise * noise;
  const float least = noise / settings.max_texture_sigma_px;
  const float least_energy = noise_energy + 2 * least * least;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      PixelState& state =
          states[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x)];
      if (x < kBorder || y < kBorder || x >= image.width - kBorder || y >= image.height - kBorder) {
        state = PixelState::kBorder;
      } else {
        state = gradient_energy(image, x, y) < least_energy ? PixelState::kNoTexture : PixelState::kUpdating;
      }
    }
  }
}

std::uint32_t next_turns(double samples, std::uint32_t turns, double budget) {
  constexpr double kMost = 4;
  return static_cast<std::uint32_t>(std::clamp(std::ceil(samples * turns / budget), 1.0, kMost));
}

}  // namespace vantage
