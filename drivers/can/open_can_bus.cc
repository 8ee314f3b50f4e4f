#include "drivers/can/open_can_bus.h"

#include <string_view>

#include "drivers/can/socket_can_bus.h"
#include "drivers/can/unix_can_bus.h"

namespace vantage::can {
namespace {

constexpr std::string_view kSimulated = "sim:";

}  // namespace

std::unique_ptr<CanBus> open_can_bus(const std::string& name) {
  return name.starts_with(kSimulated) ? join_unix_can(name.substr(kSimulated.size())) : open_socket_can(name);
}

std::unique_ptr<CanBus> serve_can_bus(const std::string& name) {
  return name.starts_with(kSimulated) ? serve_unix_can(name.substr(kSimulated.size())) : open_socket_can(name);
}

}  // namespace vantage::can
