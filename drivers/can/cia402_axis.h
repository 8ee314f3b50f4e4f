#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "drivers/can/cia402.h"
#include "drivers/can/emergency.h"

namespace vantage::can {

/// Longest times that a drive may take. Every transition has one.
struct AxisTimeouts {
  std::chrono::nanoseconds transition{500'000'000};  ///< from one state to the next on the way up or down
  std::chrono::nanoseconds quick_stop{300'000'000};  ///< until the drive has taken the quick stop up
  std::chrono::nanoseconds fault_reset{1'000'000'000};
  std::chrono::nanoseconds homing{30'000'000'000};
  std::chrono::nanoseconds set_point{200'000'000};  ///< until a profile position is acknowledged
};

/// What an axis is to come to.
enum class AxisAim : std::uint8_t {
  kOff,        ///< switch on disabled: no voltage
  kOperation,  ///< operation enabled
  kQuickStop,  ///< quick stop active: the drive brakes by 605A and 6085, then holds or is off
  kFaultReset  ///< out of the fault, to switch on disabled
};

enum class AxisFault : std::uint8_t {
  kNone,
  kDriveFault,       ///< the drive reports one by itself
  kTimedOut,         ///< a state was not reached in time
  kUnknownState,     ///< the statusword is none of the profile's
  kLeftOperation,    ///< the drive left operation enabled by itself
  kHomingFailed,     ///< the drive gave up, or took too long
  kSetPointIgnored,  ///< a profile position was not acknowledged
  kHeartbeatLost,
  kRebooted,
  kNoProcessData,
  kFollowingError,
  kLimit  ///< the actual position is outside its limits
};

/// A fault and all that names it; made without allocation, told in words by `to_text`.
struct AxisFailure {
  AxisFault fault = AxisFault::kNone;
  AxisAim aim = AxisAim::kOff;
  DriveState state = DriveState::kNotReady;
  std::uint16_t statusword = 0;
  std::uint16_t controlword = 0;
  std::uint16_t error_code = 0;        ///< of the last emergency; 0: none
  std::chrono::nanoseconds waited{0};  ///< in that state
  double value = 0, limit = 0;         ///< of kFollowingError and kLimit, in the axis's own unit (rad)

  explicit operator bool() const { return fault != AxisFault::kNone; }
};

/// "joint_3 (node 3): stayed in "switched on" for 0.50 s on the way to operation enabled (6041 statusword 0x0233, 6040
/// controlword 0x000F)".
std::string to_text(const AxisFailure& failure, const std::string& axis, std::uint8_t node);

/// The state machine of one drive, seen from the master (CiA 402): from each statusword it finds the next controlword.
///
/// Knows no bus: `step` is called once a cycle with what the drive's PDO says, and allocates nothing. A failure stays
/// until `aim` is called again.
class Cia402Axis {
 public:
  explicit Cia402Axis(const AxisTimeouts& timeouts = {}) : timeouts_(timeouts) {}

  /// Sets a new aim, forgets an earlier failure.
  void aim(AxisAim aim, std::chrono::nanoseconds now);
  /// Starts homing; the mode in force must be kHoming and the aim kOperation.
  void start_homing(std::chrono::nanoseconds now);
  /// Hands a target position over in profile position mode: the controlword's bit 4 rises until the drive takes it.
  void start_move(std::chrono::nanoseconds now);

  /// The controlword that answers a statusword.
  std::uint16_t step(std::uint16_t statusword, std::chrono::nanoseconds now);
  /// Reports a failure that is seen outside the statusword. The first one stays.
  void fail(const AxisFailure& failure);
  /// The drive's last emergency, for failures that follow.
  void set_error_code(std::uint16_t code) { error_code_ = code; }

  AxisAim aimed() const { return aim_; }
  bool arrived() const { return arrived_; }
  DriveState state() const { return state_; }
  std::uint16_t last_statusword() const { return statusword_; }
  /// In homing mode, after `start_homing`: the drive has found its zero.
  bool homed() const { return homing_ == Phase::kDone; }
  /// In profile position, after `start_move`: the target is taken, and reached.
  bool moved() const { return move_ == Phase::kDone; }
  const AxisFailure& failure() const { return failure_; }

 private:
  enum class Phase : std::uint8_t { kIdle, kAsked, kRunning, kDone };

  std::uint16_t towards_operation();
  std::uint16_t towards_off() const;
  std::uint16_t towards_quick_stop();
  std::uint16_t towards_fault_reset();
  std::uint16_t operating(std::chrono::nanoseconds now);
  void check_time(std::chrono::nanoseconds now);
  void fail(AxisFault fault, std::chrono::nanoseconds waited);

  AxisTimeouts timeouts_;
  AxisAim aim_ = AxisAim::kOff;
  DriveState state_ = DriveState::kNotReady;
  std::uint16_t statusword_ = 0, controlword_ = 0;
  std::uint16_t error_code_ = 0;
  bool arrived_ = false, was_operating_ = false, reset_raised_ = false;
  std::chrono::nanoseconds since_{0};  // in this state under this aim
  Phase homing_ = Phase::kIdle, move_ = Phase::kIdle;
  std::chrono::nanoseconds homing_since_{0}, move_since_{0};
  int unknown_ = 0;  // statuswords in a row that are none of the profile's
  AxisFailure failure_;
};

}  // namespace vantage::can
