#pragma once

#include <cstdint>

namespace vantage {

/// What a pixel of the key frame is doing. `kConverged` and `kDiverged` hold until a new key frame; the four others say
/// what the last frame gave.
enum class PixelState : std::uint8_t {
  kUpdating = 0,    ///< searched with success, or nothing to be learnt from the last frame (no parallax, ambiguous)
  kConverged = 1,   ///< inverse depth known, most matches right
  kDiverged = 2,    ///< given up: most searches found nothing, or nothing that agrees
  kBorder = 3,      ///< too near the image's edge for a patch; never searched
  kNotVisible = 4,  ///< outside the last frame's image
  kNoMatch = 5,     ///< searched in the last frame, not found
  kNoTexture = 6    ///< without gradient; never searched
};
inline constexpr int kPixelStates = 7;

}  // namespace vantage
