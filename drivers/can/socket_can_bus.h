#pragma once

#include <memory>
#include <string>

#include "drivers/can/can_bus.h"

namespace vantage::can {

/// A CAN interface of the kernel (SocketCAN, CAN_RAW).
///
/// Receives nothing but error frames before `accept_only`. Frames carry the kernel's time stamp, moved from
/// CLOCK_REALTIME to CLOCK_MONOTONIC; one that lies in the future or more than a second back is replaced by the time of
/// reading and counted. The socket stays good while the interface is set down and up again.
///
/// \throws InputError when the interface does not exist, is no CAN interface, or can't be opened.
std::unique_ptr<CanBus> open_socket_can(const std::string& interface);

}  // namespace vantage::can
