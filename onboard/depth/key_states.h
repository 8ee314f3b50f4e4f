#pragma once

#include <span>

#include "onboard/depth/image_pyramid.h"
#include "onboard/depth/pixel_update.h"

namespace vantage {

/// The states that a key frame's pixels begin with, row-major: kBorder; kNoTexture where the gradient of a patch,
/// whatever the line's direction, is no more than noise makes or leaves the place too uncertain; else kUpdating. The
/// image's noise is estimated, and believed up to `settings.image_noise`.
void find_key_states(const ImagePyramid::Level& image, const PixelSettings& settings, std::span<PixelState> states);

/// In how many turns a key frame's first update is made: its searches are long.
inline constexpr std::uint32_t kFirstTurns = 4;

/// In how many turns the next update is made, so that it takes about `budget` samples: its searches will be as long as
/// those of the last, which took `samples` in one of `turns`.
std::uint32_t next_turns(double samples, std::uint32_t turns, double budget);

}  // namespace vantage
