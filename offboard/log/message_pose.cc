#include "offboard/log/message_pose.h"

#include "lcmtypes/link/pose_fields.h"

namespace vantage {
namespace {

/// What pose_of takes.
struct PoseFields {
  double position[3], quaternion_xyzw[4];
};

}  // namespace

std::optional<Eigen::Isometry3d> pose_in(const MessageFields& message) {
  const MessageField* position = message.find("position");
  const MessageField* quaternion = message.find("quaternion_xyzw");
  if (position == nullptr || quaternion == nullptr) return std::nullopt;
  PoseFields fields{};
  for (std::size_t i = 0; i < 3; ++i) fields.position[i] = position->number(i);
  for (std::size_t i = 0; i < 4; ++i) fields.quaternion_xyzw[i] = quaternion->number(i);
  return pose_of(fields);
}

}  // namespace vantage
