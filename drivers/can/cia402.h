#pragma once

#include <cstdint>
#include <optional>

namespace vantage::can {

/// States of a drive (CiA 402, 6041).
enum class DriveState : std::uint8_t {
  kNotReady,
  kSwitchOnDisabled,
  kReadyToSwitchOn,
  kSwitchedOn,
  kOperationEnabled,
  kQuickStopActive,
  kFaultReaction,
  kFault
};

/// The state that a statusword tells; nothing when its bits are none of the profile's.
constexpr std::optional<DriveState> drive_state(std::uint16_t statusword) {
  switch (statusword & 0x4F) {
    case 0x00:
      return DriveState::kNotReady;
    case 0x40:
      return DriveState::kSwitchOnDisabled;
    case 0x0F:
      return DriveState::kFaultReaction;
    case 0x08:
      return DriveState::kFault;
    default:
      break;
  }
  switch (statusword & 0x6F) {
    case 0x21:
      return DriveState::kReadyToSwitchOn;
    case 0x23:
      return DriveState::kSwitchedOn;
    case 0x27:
      return DriveState::kOperationEnabled;
    case 0x07:
      return DriveState::kQuickStopActive;
    default:
      return {};
  }
}

constexpr const char* to_text(DriveState state) {
  switch (state) {
    case DriveState::kNotReady:
      return "not ready to switch on";
    case DriveState::kSwitchOnDisabled:
      return "switch on disabled";
    case DriveState::kReadyToSwitchOn:
      return "ready to switch on";
    case DriveState::kSwitchedOn:
      return "switched on";
    case DriveState::kOperationEnabled:
      return "operation enabled";
    case DriveState::kQuickStopActive:
      return "quick stop active";
    case DriveState::kFaultReaction:
      return "fault reaction active";
    case DriveState::kFault:
      return "fault";
  }
  return "";
}

/// Values of 6060 and 6061.
enum class DriveMode : std::int8_t {
  kNone = 0,
  kProfilePosition = 1,
  kProfileVelocity = 3,
  kHoming = 6,
  kCyclicPosition = 8,
  kCyclicVelocity = 9,
  kCyclicTorque = 10
};

/// The mode's bit in 6502.
constexpr std::uint32_t mode_bit(DriveMode mode) { return 1U << (static_cast<int>(mode) - 1); }

constexpr const char* to_text(DriveMode mode) {
  switch (mode) {
    case DriveMode::kNone:
      return "no mode";
    case DriveMode::kProfilePosition:
      return "profile position";
    case DriveMode::kProfileVelocity:
      return "profile velocity";
    case DriveMode::kHoming:
      return "homing";
    case DriveMode::kCyclicPosition:
      return "cyclic synchronous position";
    case DriveMode::kCyclicVelocity:
      return "cyclic synchronous velocity";
    case DriveMode::kCyclicTorque:
      return "cyclic synchronous torque";
  }
  return "a mode of the maker's own";
}

namespace controlword {
inline constexpr std::uint16_t kDisableVoltage = 0x00, kQuickStop = 0x02, kShutdown = 0x06, kSwitchOn = 0x07,
                               kEnableOperation = 0x0F;
inline constexpr std::uint16_t kNewSetPoint = 0x10;   ///< profile position: its rising edge starts a movement
inline constexpr std::uint16_t kStartHoming = 0x10;   ///< homing
inline constexpr std::uint16_t kChangeAtOnce = 0x20;  ///< profile position: does not finish the one before
inline constexpr std::uint16_t kFaultReset = 0x80;    ///< its rising edge
inline constexpr std::uint16_t kHalt = 0x100;
}  // namespace controlword

namespace statusword {
inline constexpr std::uint16_t kVoltage = 0x10, kWarning = 0x80;
inline constexpr std::uint16_t kTargetReached = 0x400;
inline constexpr std::uint16_t kInternalLimit = 0x800;
inline constexpr std::uint16_t kSetPointTaken = 0x1000;   ///< profile position
inline constexpr std::uint16_t kHomingAttained = 0x1000;  ///< homing
inline constexpr std::uint16_t kFollowsTarget = 0x1000;   ///< cyclic modes
inline constexpr std::uint16_t kFollowingError = 0x2000;  ///< position modes
inline constexpr std::uint16_t kHomingError = 0x2000;     ///< homing
}  // namespace statusword

}  // namespace vantage::can
