#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "drivers/can/can_bus.h"
#include "drivers/can/cia402.h"
#include "drivers/can/nmt.h"
#include "drivers/can/pdo.h"
#include "drivers/sim/drive_dictionary.h"
#include "drivers/sim/drive_motor.h"

namespace vantage::sim {

/// Objects of the maker's own: how a test or a person makes a simulated drive fail, over the bus.
inline constexpr can::ObjectAddress kAxisLabel{0x2000, 0};    ///< a text that can be written
inline constexpr can::ObjectAddress kTripObject{0x2F00, 0};   ///< written: the drive faults with this code of 603F
inline constexpr can::ObjectAddress kBlockObject{0x2F01, 0};  ///< 1: the motor is blocked
inline constexpr can::ObjectAddress kSilentObject{0x2F02,
                                                  0};  ///< 1: the drive's electronics hang: it says nothing more

struct SimDriveOptions {
  std::uint8_t node = 1;
  std::string label = "axis";
  MotorOptions motor{};
  /// Machine positions of the limit switches that homing looks for; the switch is closed beyond.
  double negative_switch = -1e12, positive_switch = 1e12;
};

/// A drive of CiA 301 and CiA 402 on a CAN bus, with motor: what a master sees of a real one.
///
/// Network management, SDO server, four PDOs each way (by SYNC or at once), heartbeat producer and consumer with its
/// reaction, emergencies; modes profile position, profile velocity, homing (methods 17, 18, 35, 37), CSP and CSV; quick
/// stop, fault reaction and reset; following error and software limits. The position after switching on is 0 wherever
/// the motor stands, as an incremental encoder's is, until it is homed.
class SimDrive {
 public:
  SimDrive(const SimDriveOptions& options, std::chrono::nanoseconds now);

  /// Says that it has started (boot-up).
  void start(can::CanBus& bus);
  void receive(const can::CanFrame& frame, can::CanBus& bus);
  /// Lets time pass: motor, timers, heartbeat. `now` never goes back.
  void advance(std::chrono::nanoseconds now, can::CanBus& bus);

  std::uint8_t node() const { return options_.node; }
  DriveDictionary& dictionary() { return dictionary_; }
  const DriveMotor& motor() const { return motor_; }
  can::DriveState state() const { return state_; }
  can::NmtState nmt() const { return nmt_; }
  bool homed() const { return homed_; }
  std::int32_t actual_position() const;
  std::uint16_t statusword() const;
  /// Cuts the power: silent from now on. `start` brings it back as after switching on.
  void kill() { alive_ = false; }
  bool alive() const { return alive_; }

 private:
  enum class HomingPhase { kIdle, kToSwitch, kOffSwitch, kDone, kFailed };

  void define_objects();
  std::optional<can::SdoAbort> judge(can::ObjectAddress address, std::int64_t value) const;
  std::optional<can::SdoAbort> judge_mapping(can::ObjectAddress address, std::int64_t value) const;
  void written(can::ObjectAddress address, std::int64_t value);
  void reset_node(can::CanBus& bus);
  void obey_nmt(can::NmtCommand command, can::CanBus& bus);
  void on_sync(can::CanBus& bus);
  void apply_rpdo(int number, std::span<const std::uint8_t> data);
  void send_tpdo(int number, can::CanBus& bus);
  void obey_controlword();
  void enter(can::DriveState state);
  void trip(std::uint16_t code);
  void watch_master(can::CanBus& bus);
  void send_heartbeat_if_due(can::CanBus& bus);
  void send_emergency(std::uint16_t code, can::CanBus& bus);
  void step(double dt);
  void operate(double dt);
  void operate_profile(double dt);
  void operate_homing(double dt);
  bool brake(double dt);
  void watch_following_error(double dt);
  void finish_homing();
  double demand_from(double target) const;
  can::DriveMode mode() const;
  double number(can::ObjectAddress address) const { return static_cast<double>(dictionary_.get(address)); }

  SimDriveOptions options_;
  DriveDictionary dictionary_;
  DriveMotor motor_;
  bool alive_ = true;
  std::chrono::nanoseconds now_, started_;
  can::NmtState nmt_ = can::NmtState::kPreOperational;
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

  std::chrono::nanoseconds next_heartbeat_{0};
  std::chrono::nanoseconds master_heard_{-1};  // negative: not watched yet
  bool master_lost_ = false;
  std::uint16_t pending_emergency_ = 0;
  bool emergency_waits_ = false;
  std::array<std::optional<can::CanFrame>, 4> waiting_rpdo_;  // until the next SYNC
};

}  // namespace vantage::sim
