#pragma once

#include <optional>

#include <Eigen/Geometry>

#include "offboard/log/known_channels.h"

namespace vantage {

/// The pose of a message that has `position` and `quaternion_xyzw`. Nothing when it has none, or one that is not rigid.
std::optional<Eigen::Isometry3d> pose_in(const MessageFields& message);

}  // namespace vantage
