#include "drivers/robot/drive_setups.h"

#include <algorithm>
#include <cmath>

#include "drivers/can/eds.h"

namespace vantage {
namespace {

using can::DriveMode;
using std::chrono::milliseconds;

/// A quick stop brakes so much harder than planned motion: from full speed it takes a quarter of the usual time, so
/// that with `stop_after` a drive whose master hangs stands within 300 ms.
constexpr double kQuickStopFactor = 4;
/// The drives' own limits lie so far outside ours: they are the second line, and must not trip before the first.
constexpr double kDriveMargin = 1.5;
constexpr milliseconds kDriveHeartbeat{50};
constexpr double kHomingZeroPart = 0.1;  // of the homing speed, off the switch

std::uint32_t increments(double value) { return static_cast<std::uint32_t>(std::lround(std::max(value, 1.0))); }

can::DriveSetup common_setup(const DrivesRig& rig, const DriveRig& drive) {
  can::DriveSetup setup;
  setup.name = drive.name;
  setup.node = static_cast<std::uint8_t>(drive.node);
  setup.cycle = rig.cycle;
  setup.master_timeout = rig.stop_after;
  setup.heartbeat_period = kDriveHeartbeat;
  setup.encoder_increments = static_cast<std::uint32_t>(drive.encoder);
  if (!drive.eds.empty()) {
    const can::Eds eds = can::load_eds(drive.eds, setup.node);
    setup.objects = can::corrected_by(can::profile_objects(), eds.objects);
    setup.vendor = eds.vendor;
    setup.product = eds.product;
  }
  return setup;
}

}  // namespace

can::DriveSetup joint_setup(const DrivesRig& rig, const JointRig& joint) {
  can::DriveSetup setup = common_setup(rig, joint.drive);
  const double scale = std::abs(joint.drive.increments_per_rad());
  setup.mode = DriveMode::kCyclicPosition;
  setup.quick_stop_deceleration = increments(kQuickStopFactor * joint.acceleration_rad_s2 * scale);
  setup.profile_speed = increments(kDriveMargin * joint.speed_rad_s * scale);
  setup.profile_acceleration = increments(kDriveMargin * joint.acceleration_rad_s2 * scale);
  setup.following_error_window = increments(kDriveMargin * joint.following_error_rad * scale);
  const auto position = [&joint](double angle) {
    return static_cast<std::int32_t>(std::lround((angle - joint.zero_rad) * joint.drive.increments_per_rad()));
  };
  // The switch itself may lie outside the range; homing ends there.
  const double low = std::min(joint.lower_rad, joint.zero_rad) - kRangeMargin_rad;
  const double high = std::max(joint.upper_rad, joint.zero_rad) + kRangeMargin_rad;
  setup.lowest_position = std::min(position(low), position(high));
  setup.highest_position = std::max(position(low), position(high));
  setup.homing = {joint.homing_method, increments(joint.homing_speed_rad_s * scale),
                  increments(kHomingZeroPart * joint.homing_speed_rad_s * scale),
                  increments(joint.acceleration_rad_s2 * scale), 0};
  return setup;
}

can::DriveSetup wheel_setup(const DrivesRig& rig, const BaseRig& base, const DriveRig& wheel) {
  constexpr int kHomeHere = 37;
  can::DriveSetup setup = common_setup(rig, wheel);
  const double per_metre = std::abs(wheel.increments_per_rad()) / base.wheel_radius_m;
  setup.mode = DriveMode::kCyclicVelocity;
  setup.quick_stop_deceleration = increments(kQuickStopFactor * base.acceleration_m_s2 * per_metre);
  setup.profile_speed = increments(kDriveMargin * base.speed_m_s * per_metre);
  setup.profile_acceleration = increments(kDriveMargin * base.acceleration_m_s2 * per_metre);
  setup.following_error_window = static_cast<std::uint32_t>(wheel.encoder);
  setup.homing = {kHomeHere, setup.profile_speed, setup.profile_speed, setup.profile_acceleration, 0};
  return setup;
}

}  // namespace vantage
