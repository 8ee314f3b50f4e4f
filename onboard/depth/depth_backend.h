#pragma once

#include <array>
#include <span>

#include "drivers/camera/frame_source.h"
#include "onboard/depth/epipolar_line.h"
#include "onboard/depth/pixel_belief.h"
#include "onboard/depth/pixel_state.h"

namespace vantage {

/// How one update went, in pixels.
struct UpdateCounts {
  std::array<int, kPixelStates> states{};  ///< of the whole key frame, after the update, by PixelState
  int planned = 0;                         ///< pixels whose turn it was, neither given up nor settled
  int not_visible = 0;                     ///< of these, outside the frame's image
  double samples = 0;                      ///< of the frame's image that the searches took
  int searched = 0;                        ///< matches looked for
  int matched = 0;                         ///< and found
  int ambiguous = 0;                       ///< and left alone, since two places look alike
};

/// Where the filter's pixels live and are updated: the CPU's memory and cores, or a GPU's.
///
/// A backend is made for one image size. It allocates when it is made, never in `update`.
class DepthBackend {
 public:
  virtual ~DepthBackend() = default;

  /// Starts a key frame: its image, and per pixel, row-major, a belief to begin with. States begin as kUpdating, but
  /// kBorder and kNoTexture where they hold.
  virtual void start(const GreyImage& key_image, std::span<const PixelBelief> beliefs) = 0;

  /// Takes one more frame into account. \pre started; the image has the key image's size.
  virtual UpdateCounts update(const GreyImage& image, const PairGeometry& geometry) = 0;

  /// Copies out the present beliefs and states, row-major.
  virtual void read(std::span<PixelBelief> beliefs, std::span<PixelState> states) const = 0;
};

}  // namespace vantage
