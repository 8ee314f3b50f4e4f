#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "calib/files/strict_yaml.h"

namespace vantage {

/// One drive on the CAN bus and what it turns.
struct DriveRig {
  std::string name;         ///< as the rig file calls it: joint_1, front_left
  int node = 0;             ///< CANopen, 1 to 126
  double motor_turns = 1;   ///< gear: so many turns of the motor ...
  double output_turns = 1;  ///< ... are so many of the joint or wheel
  int encoder = 4000;       ///< increments of one motor turn
  int sign = 1;             ///< -1: a positive motor turns the joint or wheel backwards
  std::string eds;          ///< the drive's data sheet, beside the rig file; empty: none

  /// Increments of one radian of the output, with the sign.
  double increments_per_rad() const;
};

/// A joint of the arm. Angles as the kinematics count them.
struct JointRig {
  DriveRig drive;
  double zero_rad = 0;  ///< angle at the drive's position 0, which homing finds at a limit switch
  double lower_rad = 0, upper_rad = 0;
  double speed_rad_s = 0, acceleration_rad_s2 = 0;
  double following_error_rad = 0;
  double homing_speed_rad_s = 0;
  int homing_method = 0;  ///< of CiA 402: 17 towards negative increments, 18 towards positive ones
};

/// A base on four mecanum wheels with rollers at 45 degrees.
struct BaseRig {
  double wheel_radius_m = 0;
  double length_m = 0, width_m = 0;  ///< between the axles; between the wheels' middles
  double speed_m_s = 0, turn_speed_rad_s = 0;
  double acceleration_m_s2 = 0, turn_acceleration_rad_s2 = 0;
  double speed_error_rad_s = 0;    ///< of a wheel, that may last no longer than a moment
  std::array<DriveRig, 4> wheels;  ///< front left, front right, back left, back right
};

/// The drives of a robot and the beat that they work in.
struct DrivesRig {
  std::chrono::milliseconds cycle{10};
  std::chrono::milliseconds heartbeat{20};    ///< of this computer
  std::chrono::milliseconds stop_after{100};  ///< of its silence, the drives stop by themselves
  std::vector<JointRig> joints;               ///< from the base to the wrist; may be empty
  std::optional<BaseRig> base;

  std::size_t axes() const { return joints.size() + (base ? base->wheels.size() : 0); }
};

/// Reads the `drives` part of a rig file. \throws InputError as load_rig, also when two drives have one node, a limit
/// contradicts another, or a gear is none.
DrivesRig read_drives(YamlMap map);

}  // namespace vantage
