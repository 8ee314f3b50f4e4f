#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "drivers/can/cia402.h"
#include "drivers/robot/mecanum.h"

namespace vantage {

inline constexpr std::size_t kMostAxes = 16;

/// One joint or wheel, as its drive last told.
struct AxisState {
  can::DriveState drive = can::DriveState::kNotReady;
  double position_rad = 0;         ///< a joint's angle, a wheel's angle turned since switching on
  double speed_rad_s = 0;          ///< from the last two positions
  double following_error_rad = 0;  ///< joints: where it should have been less where it was
  bool homed = false;
  bool limited = false;              ///< the last wish was cut to the limits
  std::chrono::nanoseconds time{0};  ///< CLOCK_MONOTONIC of the drive's frame
};

enum class DrivesPhase : std::uint8_t {
  kOff,      ///< not set up
  kReady,    ///< set up, without power
  kEnabled,  ///< holds or moves
  kFault     ///< everything is stopped; `recover` leads out
};

/// Arm and base at one cycle.
struct RobotState {
  std::chrono::nanoseconds time{0};  ///< of the cycle
  std::uint64_t cycle = 0;
  DrivesPhase phase = DrivesPhase::kOff;
  std::size_t joints = 0, axes = 0;  ///< the joints come first, then the four wheels
  std::array<AxisState, kMostAxes> axis{};
  BasePose base;
  BaseTwist base_speed;  ///< measured
};

/// What a caller wants. Whatever it is, the limits of the rig hold.
struct RobotCommand {
  enum class Arm : std::uint8_t { kHold, kPosition, kSpeed };
  Arm arm = Arm::kHold;
  std::array<double, kMostAxes> joints{};  ///< rad or rad/s
  BaseTwist base;
  std::chrono::nanoseconds valid_until{0};  ///< afterwards the arm holds and the base stops
};

}  // namespace vantage
