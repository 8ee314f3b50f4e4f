#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "onboard/depth/depth_backend.h"
#include "onboard/depth/image_pyramid.h"
#include "onboard/depth/pixel_update.h"

namespace vantage {

/// All that the update of any pixel reads and writes.
struct UpdateJob {
  PairGeometry geometry;
  PixelSettings settings;
  std::array<ImagePyramid::Level, ImagePyramid::kLevels> key;
  std::array<ImagePyramid::Level, ImagePyramid::kLevels> frame;
  std::uint32_t turns = 1;         ///< a pixel is updated in one of so many frames ...
  std::uint32_t turn = 0;          ///< ... and this is that one's number
  PixelBelief* beliefs = nullptr;  ///< row-major, whole image
  PixelState* states = nullptr;
};

/// Updates the pixels numbered in `active` and moves those that stay active to its front, in order.
/// Returns how many stay; adds to all of `counts` but the states. Uses the widest vectors this machine
/// has (Highway's run-time dispatch).
int update_pixels(const UpdateJob& job, std::span<std::uint32_t> active, UpdateCounts* counts);

/// Name of the instruction set that update_pixels uses here.
const char* update_pixels_target();

}  // namespace vantage
