#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "calib/drives_rig.h"
#include "drivers/can/can_bus.h"
#include "drivers/sim/sim_drive.h"
#include "lcmtypes/link/clock.h"

namespace vantage::sim {

/// The drives of a robot as its rig file describes them: nodes, ranges, limit switches at the zeros, joints somewhere
/// in the middle of their range (by `seed`), as after switching on.
std::vector<SimDriveOptions> drives_of(const DrivesRig& rig, std::uint64_t seed);

/// Simulated drives on one CAN bus.
class DriveRack {
 public:
  /// Bus and clock must outlive it.
  DriveRack(can::CanBus& bus, const Clock& clock, const std::vector<SimDriveOptions>& drives);

  /// Switches all on: each says so on the bus.
  void start();
  /// Lets time pass up to now and answers what came in.
  void step();
  /// Steps until `stop`: wakes for frames, and for time every five milliseconds.
  void serve(const std::atomic<bool>& stop);

  std::vector<std::unique_ptr<SimDrive>>& drives() { return drives_; }

 private:
  can::CanBus& bus_;
  const Clock& clock_;
  std::vector<std::unique_ptr<SimDrive>> drives_;
};

}  // namespace vantage::sim
