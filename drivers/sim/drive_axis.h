#pragma once

#include <cstdint>
#include <optional>

#include "drivers/can/cia402.h"
#include "drivers/can/object_table.h"
#include "drivers/sim/drive_dictionary.h"
#include "drivers/sim/drive_motor.h"

namespace vantage::sim {

/// Machine positions of the limit switches that homing looks for; a switch is closed beyond.
struct LimitSwitches {
  double negative = -1e12, positive = 1e12;
};

/// The CiA 402 half of a simulated drive: state machine, modes and motor, all told and read through the drive's
/// objects.
///
/// Modes: profile position, profile velocity, homing (methods 17, 18, 35, 37), CSP and CSV; quick stop, fault reaction
/// and reset; following error and software limits. The position after switching on is 0 wherever the motor stands, as
/// an incremental encoder's is, until it is homed.
class DriveAxis {
 public:
  /// `dictionary` must outlive it.
  DriveAxis(DriveDictionary& dictionary, const MotorOptions& motor, const LimitSwitches& switches);

  /// As after switching on: not ready, not homed, counting from here.
  void switch_on();
  void get_ready();
  /// Acts on 6040.
  void obey_controlword();
  void quick_stop();
  void disable_voltage();
  /// Takes 607A as the position to be at one cycle from now.
  void on_sync();
  /// The network is no longer operational: no target any more.
  void forget_target() { has_target_ = false; }
  /// Faults, with this code of 603F.
  void trip(std::uint16_t code);
  void block_motor(bool blocked) { motor_.block(blocked); }

  /// Lets `dt` seconds pass, a millisecond at most.
  void step(double dt);
  /// The same without electronics.
  void coast(double dt) { motor_.coast(dt); }
  /// Brings 6041, 6064, 606C and 60F4 up to date.
  void measure();
  /// An emergency that is to be sent; 0: a fault is over. Each once.
  std::optional<std::uint16_t> take_emergency();

  const DriveMotor& motor() const { return motor_; }
  can::DriveState state() const { return state_; }
  bool homed() const { return homed_; }
  std::int32_t actual_position() const;
  std::uint16_t statusword() const;

 private:
  enum class HomingPhase { kIdle, kToSwitch, kOffSwitch, kDone, kFailed };

  void enter(can::DriveState state);
  void operate(double dt);
  void operate_profile(double dt);
  void operate_homing(double dt);
  bool brake(double dt);
  void watch_following_error(double dt);
  void finish_homing();
  double demand_from(double target) const;
  can::DriveMode mode() const;
  double number(can::ObjectAddress address) const { return static_cast<double>(dictionary_.get(address)); }

  DriveDictionary& dictionary_;
  DriveMotor motor_;
  LimitSwitches switches_;
  can::DriveState state_ = can::DriveState::kNotReady;
  std::uint16_t last_controlword_ = 0;
  double origin_ = 0;  // machine position of the drive's zero
  bool homed_ = false;
  double demand_ = 0, demand_speed_ = 0;      // machine scale
  double sync_target_ = 0, sync_left_s_ = 0;  // of the interpolation between two SYNCs
  bool has_target_ = false;
  double profile_target_ = 0;
  bool profile_moving_ = false, set_point_taken_ = false;
  HomingPhase homing_ = HomingPhase::kIdle;
  double following_time_s_ = 0;
  bool following_warning_ = false, limited_ = false;
  std::optional<std::uint16_t> emergency_;
};

}  // namespace vantage::sim
