#pragma once

#include <memory>

#include "calib/rig.h"
#include "drivers/can/memory_can_bus.h"
#include "drivers/robot/robot_drives.h"
#include "drivers/sim/drive_rack.h"
#include "lcmtypes/link/clock.h"

namespace vantage {

/// A robot's drives, its bus and the computer that drives it, in one thread and on one clock.
class SimulatedRobot {
 public:
  static constexpr std::uint64_t kSeed = 7;

  SimulatedRobot()
      : rig_(*load_rig(VANTAGE_SOURCE_DIR "/calib/rigs/youbot.yaml").drives),
        drive_side_(network_.attach("drives")),
        rack_(*drive_side_, clock_, sim::drives_of(rig_, kSeed)),
        robot_side_(network_.attach("robot")),
        robot_(*robot_side_, clock_, rig_) {
    network_.on_tick([this] { rack_.step(); });
    rack_.start();
    pass(std::chrono::milliseconds(100));
  }

  const DrivesRig& rig() const { return rig_; }
  ManualClock& clock() { return clock_; }
  can::MemoryCanNetwork& network() { return network_; }
  RobotDrives& robot() { return robot_; }
  sim::SimDrive& drive(std::size_t axis) { return *rack_.drives()[axis]; }

  void pass(std::chrono::nanoseconds time) { network_.advance_to(clock_.monotonic() + time); }
  RobotCommand command() const {
    RobotCommand command;
    command.valid_until = clock_.monotonic() + std::chrono::seconds(1);
    return command;
  }
  /// The truth: a joint's angle, or how far a wheel has turned.
  double angle(std::size_t axis) {
    const double position = drive(axis).motor().position();
    if (axis >= rig_.joints.size()) {
      return position / rig_.base->wheels[axis - rig_.joints.size()].increments_per_rad();
    }
    return rig_.joints[axis].zero_rad + position / rig_.joints[axis].drive.increments_per_rad();
  }

 private:
  ManualClock clock_;
  can::MemoryCanNetwork network_{clock_};
  DrivesRig rig_;
  std::unique_ptr<can::CanBus> drive_side_;
  sim::DriveRack rack_;
  std::unique_ptr<can::CanBus> robot_side_;
  RobotDrives robot_;
};

}  // namespace vantage
