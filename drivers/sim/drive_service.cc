#include "drivers/sim/drive_service.h"

#include "drivers/can/open_can_bus.h"

namespace vantage::sim {

DriveService::DriveService(const std::string& bus, const DrivesRig& rig, std::uint64_t seed)
    : bus_(can::serve_can_bus(bus)), rack_(*bus_, clock_, drives_of(rig, seed)) {
  rack_.start();
  thread_ = std::thread([this] { rack_.serve(stop_); });
}

DriveService::~DriveService() {
  stop_ = true;
  thread_.join();
}

}  // namespace vantage::sim
