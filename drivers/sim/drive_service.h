#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include "calib/drives_rig.h"
#include "drivers/can/can_bus.h"
#include "drivers/sim/drive_rack.h"
#include "lcmtypes/link/clock.h"

namespace vantage::sim {

/// The drives of a rig, served in real time by a thread of its own: to anyone's master.
class DriveService {
 public:
  /// `bus`: an interface of the kernel, or sim:SOCKET, which is served. \throws InputError when it can't be had.
  DriveService(const std::string& bus, const DrivesRig& rig, std::uint64_t seed);
  ~DriveService();
  DriveService(const DriveService&) = delete;
  DriveService& operator=(const DriveService&) = delete;

 private:
  SystemClock clock_;
  std::unique_ptr<can::CanBus> bus_;
  DriveRack rack_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace vantage::sim
