#pragma once

#include <memory>
#include <string>

#include "drivers/can/can_bus.h"

namespace vantage::can {

/// What a person names: "can0", an interface of the kernel, or "sim:SOCKET", a bus that vantage-sim serves.
/// \throws InputError when it does not exist.
std::unique_ptr<CanBus> open_can_bus(const std::string& name);

/// The same for who brings the bus about: serves SOCKET instead of joining it.
std::unique_ptr<CanBus> serve_can_bus(const std::string& name);

}  // namespace vantage::can
