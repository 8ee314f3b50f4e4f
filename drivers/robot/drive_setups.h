#pragma once

#include "calib/drives_rig.h"
#include "drivers/can/drive_setup.h"

namespace vantage {

/// Further than this beyond its range, the limit switch included, a joint is never, unless something is wrong.
inline constexpr double kRangeMargin_rad = 0.02;

/// What the rig file of a robot means for the drive of a joint, in increments: cyclic synchronous position, homing,
/// limits somewhat outside those that RobotDrives keeps itself. Reads the drive's EDS.
/// \throws InputError when the EDS can't be read.
can::DriveSetup joint_setup(const DrivesRig& rig, const JointRig& joint);
/// The same for a wheel: cyclic synchronous velocity. \throws InputError as above.
can::DriveSetup wheel_setup(const DrivesRig& rig, const BaseRig& base, const DriveRig& wheel);

}  // namespace vantage
