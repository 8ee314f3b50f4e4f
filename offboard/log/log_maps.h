#pragma once

#include <filesystem>
#include <functional>

#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// Every depth map of a log in the order in which they became whole, those in chunks too.
/// \throws InputError when the log is none or damaged, or a depth map does not hold; whatever `on_map` throws.
void for_each_depth_map(const std::filesystem::path& log, const std::function<void(const DepthMap&)>& on_map);

}  // namespace vantage
