#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "drivers/camera/frame_source.h"
#include "lcmtypes/link/depth_map.h"
#include "onboard/depth/pixel_state.h"

namespace vantage {

/// Writes the depth (along z) of a map's converged pixels as a 16-bit PNG of `unit_m` a step, 0 elsewhere and where it
/// does not fit. \throws InputError when it can't be written.
void write_depth_png(const std::filesystem::path& path, const DepthMap& map, double unit_m);

/// Writes the converged pixels as points of the world, PLY. \throws InputError when it can't be written.
void write_depth_ply(const std::filesystem::path& path, const DepthMap& map);

/// Writes one picture of four: the key frame; inverse depth of converged pixels from blue (far) to red (near); sigma
/// over depth from blue (0) to red (5 %); and what each pixel is doing, in the colours that docs/depth.md lists.
/// \throws InputError when it can't be written.
void write_depth_picture(const std::filesystem::path& path, const GreyImage& key_image, const DepthMap& map,
                         std::span<const PixelState> states);

}  // namespace vantage
