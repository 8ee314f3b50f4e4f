#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "drivers/can/can_bus.h"
#include "drivers/can/nmt.h"
#include "drivers/can/pdo.h"
#include "drivers/sim/drive_axis.h"
#include "drivers/sim/drive_dictionary.h"
#include "drivers/sim/drive_objects.h"

namespace vantage::sim {

struct SimDriveOptions {
  std::uint8_t node = 1;
  std::string label = "axis";
  MotorOptions motor{};
  LimitSwitches switches{};
};

/// A drive of CiA 301 and CiA 402 on a CAN bus, with motor: what a master sees of a real one.
///
/// This half is CiA 301: network management, SDO server, four PDOs each way (by SYNC or at once), heartbeat producer
/// and consumer with its reaction, emergencies. DriveAxis is the other.
class SimDrive {
 public:
  SimDrive(const SimDriveOptions& options, std::chrono::nanoseconds now);
  SimDrive(const SimDrive&) = delete;
  SimDrive& operator=(const SimDrive&) = delete;

  /// Says that it has started (boot-up).
  void start(can::CanBus& bus);
  void receive(const can::CanFrame& frame, can::CanBus& bus);
  /// Lets time pass: motor, timers, heartbeat. `now` never goes back.
  void advance(std::chrono::nanoseconds now, can::CanBus& bus);

  std::uint8_t node() const { return options_.node; }
  DriveDictionary& dictionary() { return dictionary_; }
  const DriveMotor& motor() const { return axis_.motor(); }
  can::DriveState state() const { return axis_.state(); }
  can::NmtState nmt() const { return nmt_; }
  std::int32_t actual_position() const { return axis_.actual_position(); }
  /// Cuts the power: silent from now on. `start` brings it back as after switching on.
  void kill() { alive_ = false; }
  bool alive() const { return alive_; }

 private:
  void define_objects();
  std::optional<can::SdoAbort> judge(can::ObjectAddress address, std::int64_t value) const;
  std::optional<can::SdoAbort> judge_mapping(can::ObjectAddress address, std::int64_t value) const;
  void written(can::ObjectAddress address, std::int64_t value);
  void reset_node(can::CanBus& bus);
  void obey_nmt(can::NmtCommand command, can::CanBus& bus);
  void on_sync(can::CanBus& bus);
  void apply_rpdo(int number, std::span<const std::uint8_t> data);
  void send_tpdo(int number, can::CanBus& bus);
  void watch_master(can::CanBus& bus);
  void send_heartbeat_if_due(can::CanBus& bus);
  void send_emergency(std::uint16_t code, can::CanBus& bus);

  SimDriveOptions options_;
  DriveDictionary dictionary_;
  DriveAxis axis_;
  bool alive_ = true;
  std::chrono::nanoseconds now_, started_;
  can::NmtState nmt_ = can::NmtState::kPreOperational;

  std::chrono::nanoseconds next_heartbeat_{0};
  std::chrono::nanoseconds master_heard_{-1};  // negative: not watched yet
  bool master_lost_ = false;
  std::array<std::optional<can::CanFrame>, 4> waiting_rpdo_;  // until the next SYNC
};

}  // namespace vantage::sim
