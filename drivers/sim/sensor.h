#pragma once

#include <cstdint>
#include <span>

namespace vantage::sim {

/// The exposure at which radiance 1 gives 255 grey levels.
inline constexpr double kReferenceExposure_s = 0.010;

/// A linear 8-bit image sensor: grey = 255 x radiance x exposure / reference, plus Gaussian noise of standard deviation
/// `noise_sigma` (grey levels), rounded and clipped to [0, 255].
///
/// The noise of a pixel depends on `noise_key` and the pixel's number alone: same key, same noise; another key, an
/// independent one. `grey` is as long as `radiance`.
void expose(std::span<const float> radiance, double exposure_s, double noise_sigma, std::uint64_t noise_key,
            std::span<std::uint8_t> grey);

/// One key of several numbers; every bit of each counts (SplitMix64; Steele, Lea and Flood, 2014).
std::uint64_t noise_key(std::uint64_t seed, std::uint64_t count, std::uint64_t eye);

}  // namespace vantage::sim
