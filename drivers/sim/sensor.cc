#include "drivers/sim/sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace vantage::sim {
namespace {

std::uint64_t mix(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31);
}

/// Two independent standard normal numbers from 64 random bits (Box and Muller, 1958).
void normal_pair(std::uint64_t bits, float* first, float* second) {
  const float u = (static_cast<float>(bits >> 40) + 0.5F) * 0x1p-24F;  // in (0, 1)
  const float v = static_cast<float>(bits & 0xFFFFFFU) * 0x1p-24F;
  const float radius = std::sqrt(-2 * std::log(u)), angle = 2 * std::numbers::pi_v<float> * v;
  *first = radius * std::cos(angle);
  *second = radius * std::sin(angle);
}

}  // namespace

std::uint64_t noise_key(std::uint64_t seed, std::uint64_t count, std::uint64_t eye) {
  return mix(mix(mix(seed) ^ count) ^ eye);
}

void expose(std::span<const float> radiance, double exposure_s, double noise_sigma, std::uint64_t noise_key,
            std::span<std::uint8_t> grey) {
  if (grey.size() != radiance.size()) throw std::invalid_argument("expose: the images differ in size");
  const auto gain = static_cast<float>(255 * exposure_s / kReferenceExposure_s);
  const auto sigma = static_cast<float>(noise_sigma);
  for (std::size_t i = 0; i < radiance.size(); i += 2) {
    float noise[2] = {0, 0};
    if (sigma > 0) normal_pair(mix(noise_key ^ i), &noise[0], &noise[1]);
    for (std::size_t k = i; k < std::min(i + 2, radiance.size()); ++k) {
      const float value = gain * radiance[k] + sigma * noise[k - i];
      grey[k] = static_cast<std::uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F));
    }
  }
}

}  // namespace vantage::sim
