#include "drivers/sim/drive_service.h"

#include <sys/eventfd.h>

#include "drivers/can/open_can_bus.h"

namespace vantage::sim {

DriveService::DriveService(const std::string& bus, const DrivesRig& rig, std::uint64_t seed)
    : bus_(can::serve_can_bus(bus)), rack_(*bus_, clock_, drives_of(rig, seed)), stop_(::eventfd(0, EFD_CLOEXEC)) {
  rack_.start();
  thread_ = std::thread([this] { rack_.serve(stop_.get()); });
}

DriveService::~DriveService() {
  ::eventfd_write(stop_.get(), 1);
  thread_.join();
}

}  // namespace vantage::sim
