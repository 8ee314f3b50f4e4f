#pragma once

#include <optional>
#include <string>

#include <vantage/depth_map_t.hpp>

#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// Packs a depth map for the network: inverse depth in 16 bits over the map's own range, rounded to an eighth of the
/// pixel's sigma or finer (an error of at most sigma / 16, or z^2 * (1/z_min - 1/z_max) / 131070 metres where that is
/// more: 24 um at 1 m for a map from 0.3 to 10 m), sigma in 8 bits on a logarithmic scale from 1 um to 10 m (error
/// below 3.3 %), and the state; each image as differences along its rows, compressed by zstd. Pixels that carry no
/// depth (invalid, diverged) come back as 0. \pre map.valid()
depth_map_t pack_depth_map(const DepthMap& map);

/// Unpacks and checks everything: sizes, the pose, each pixel. Nothing, with the reason in `why`, when it does not
/// hold. Memory stays below 16 bytes a pixel of the claimed image, which may have at most 2^24 pixels.
std::optional<DepthMap> unpack_depth_map(const depth_map_t& message, std::string* why);

}  // namespace vantage
