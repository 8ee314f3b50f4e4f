#pragma once

#include <filesystem>
#include <memory>

#include "drivers/can/can_bus.h"

namespace vantage::can {

/// A simulated bus between programs of one machine: one datagram of a Unix SOCK_SEQPACKET socket is one frame, laid out
/// as the kernel does. One program serves the bus, any number of others join it; each hears all the others.
///
/// A node that does not read loses frames, which its own transmit queue would do on a real bus too: the server counts
/// them as overflowed, and the others go on.
std::unique_ptr<CanBus> serve_unix_can(const std::filesystem::path& socket);

/// \throws InputError when nobody serves a bus there.
std::unique_ptr<CanBus> join_unix_can(const std::filesystem::path& socket);

}  // namespace vantage::can
