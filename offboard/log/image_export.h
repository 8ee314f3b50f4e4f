#pragma once

#include <cstdint>
#include <filesystem>

namespace vantage {

/// Steps of the exported images' values.
inline constexpr double kDepthImageStep_m = 0.0002;   ///< TUM's 5000 a metre: up to 13.1 m
inline constexpr double kSigmaImageStep_m = 0.00001;  ///< up to 0.655 m

struct ImageExport {
  std::int64_t depth_maps = 0;
  std::int64_t too_far = 0;  ///< pixels beyond what 16 bit hold: none in the image
};

/// Writes the depth maps as a recording in TUM's layout, which vantage-import reads: depth/TIME.png (16 bit, converged
/// pixels; 0: none), depth.txt, groundtruth.txt (poses), camera.yaml; and beside it sigma/TIME.png (16 bit) and
/// state/TIME.png (in colour, state_colors.h) for all pixels. `overwrite`: files of an earlier export go, others stay.
/// \throws InputError when the log is none or damaged or holds no depth map, its maps come from different cameras or
/// two have one time, the folder is not empty (unless `overwrite`) or can't be written. What it wrote is then gone.
ImageExport export_images(const std::filesystem::path& log, const std::filesystem::path& folder, bool overwrite);

}  // namespace vantage
