#pragma once

#include <memory>

#include "drivers/can/canopen_master.h"
#include "drivers/can/memory_can_bus.h"
#include "drivers/sim/drive_rack.h"

namespace vantage::can {

/// One simulated drive and a master on a bus in memory.
class SimulatedNode {
 public:
  static constexpr std::uint8_t kNode = 5;

  explicit SimulatedNode(const sim::SimDriveOptions& options = {.node = kNode})
      : drive_side_(network_.attach("drive")),
        rack_(*drive_side_, clock_, {options}),
        master_side_(network_.attach("master")),
        master_(*master_side_, clock_) {
    network_.on_tick([this] { rack_.step(); });
    master_.listen_to(kNode);
    rack_.start();
    pass(std::chrono::milliseconds(100));
  }

  ManualClock& clock() { return clock_; }
  MemoryCanNetwork& network() { return network_; }
  CanopenMaster& master() { return master_; }
  sim::SimDrive& drive() { return *rack_.drives()[0]; }
  /// The master polls meanwhile, and its heartbeat goes out.
  void pass(std::chrono::nanoseconds time) { master_.poll_until(clock_.monotonic() + time); }

 private:
  ManualClock clock_;
  MemoryCanNetwork network_{clock_};
  std::unique_ptr<CanBus> drive_side_;
  sim::DriveRack rack_;
  std::unique_ptr<CanBus> master_side_;
  CanopenMaster master_;
};

}  // namespace vantage::can
