#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include <Eigen/Geometry>

#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// Messages that Foxglove shows, as JSON (https://docs.foxglove.dev/docs/sdk/schemas). Times in us since 1970.

std::string foxglove_pose(std::int64_t utime, std::string_view frame, const Eigen::Isometry3d& pose);
std::string foxglove_transform(std::int64_t utime, std::string_view parent, std::string_view child,
                               const Eigen::Isometry3d& T_parent_child);
std::string foxglove_calibration(std::int64_t utime, std::string_view frame, const CameraModel& camera);
/// Depth in metres, 32FC1; not a number where there is none.
std::string foxglove_depth_image(std::string_view frame, const DepthMap& map);
/// The standard deviations, likewise.
std::string foxglove_sigma_image(std::string_view frame, const DepthMap& map);
/// States in colour, rgb8 (state_colors.h).
std::string foxglove_state_image(std::string_view frame, const DepthMap& map);
std::string foxglove_jpeg(std::int64_t utime, std::string_view frame, std::span<const std::uint8_t> jpeg);

/// The JSON schema of such a message, by its name with "foxglove." before it. \pre one of the types above
std::string foxglove_schema(std::string_view type);

}  // namespace vantage
